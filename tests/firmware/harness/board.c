#include "board.h"

#include <string.h>

#include <simavr/avr_adc.h>
#include <simavr/avr_extint.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

enum { CUP_PORT = 'D', CUP_BIT = 2, UART = '0', RX_BYTES = 256 };

static avr_t *avr;
static avr_irq_t *cup_irq, *vane_irq, *rx_irq;
static void (*byte_out)(uint64_t t_us, uint8_t byte);
static void (*core_reset)(avr_t *);
static bool was_reset; /* by the watchdog */

static uint32_t vane_mv = 2500;
static struct {
    double hz;
    double start; /* cycle at which the running turn began */
    unsigned edge; /* the next edge of this turn */
    unsigned bounces;
    double bounce_cycles;
} cup;

static uint8_t rx[RX_BYTES];
static size_t rx_head, rx_size;
static bool rx_off;

static void quiet(struct avr_t *a, const int level, const char *format, va_list arguments) {
    (void)a, (void)level, (void)format, (void)arguments;
}

/* simavr would sleep on the host's clock; here whoever calls board_run_until paces it. */
static void no_sleep(avr_t *a, avr_cycle_count_t cycles) { (void)a, (void)cycles; }

static void on_reset(avr_t *a) {
    if (core_reset != NULL) core_reset(a);
    was_reset = true;
}

static void sent(avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)parameter;
    byte_out(board_now_us(), (uint8_t)value);
}

static void feed(void) {
    while (rx_size != 0 && !rx_off) {
        const uint8_t byte = rx[rx_head];
        rx_head = (rx_head + 1) % RX_BYTES;
        --rx_size;
        avr_raise_irq(rx_irq, byte);
    }
}

static void on_xon(avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)value, (void)parameter;
    rx_off = false;
    feed();
}

static void on_xoff(avr_irq_t *irq, uint32_t value, void *parameter) {
    (void)irq, (void)value, (void)parameter;
    rx_off = true;
}

/* A turn has two halves, closed and open, each of which begins with 1 + 2 * bounces edges. */
static double edge_cycle(unsigned edge) {
    const unsigned half = 1 + 2 * cup.bounces;
    const double turn = 1e6 * BOARD_MHZ / cup.hz;
    return cup.start + (edge < half ? 0.0 : 0.5 * turn) + (edge % half) * cup.bounce_cycles;
}

static avr_cycle_count_t next_edge(avr_t *a, avr_cycle_count_t when, void *parameter) {
    (void)a, (void)when, (void)parameter;
    const unsigned half = 1 + 2 * cup.bounces;
    const bool odd = (cup.edge % half) % 2 != 0;
    const bool closed = (cup.edge < half) != odd;
    avr_raise_irq(cup_irq, !closed);
    if (++cup.edge == 2 * half) {
        cup.edge = 0;
        cup.start += 1e6 * BOARD_MHZ / cup.hz;
    }
    return (avr_cycle_count_t)edge_cycle(cup.edge);
}

static void schedule_cup(void) {
    avr_cycle_timer_cancel(avr, next_edge, NULL);
    if (cup.hz <= 0.0) {
        avr_raise_irq(cup_irq, 1);
        return;
    }
    const double wait = edge_cycle(cup.edge) - (double)avr->cycle;
    avr_cycle_timer_register(avr, wait < 1.0 ? 1 : (avr_cycle_count_t)wait, next_edge, NULL);
}

/* What a reset of the processor forgets, but wires and the wind do not. */
static void wire(void) {
    was_reset = false;
    avr_ioport_external_t pull_up = {.name = CUP_PORT, .mask = 1 << CUP_BIT, .value = 1 << CUP_BIT};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL(CUP_PORT), &pull_up);
    avr_raise_irq(vane_irq, vane_mv);
    schedule_cup();
}

const char *board_start(const char *elf, void (*on_byte)(uint64_t, uint8_t)) {
    static elf_firmware_t firmware;
    avr_global_logger_set(quiet);
    if (elf_read_firmware(elf, &firmware) != 0 || firmware.flashsize == 0) return "no ELF file of an AVR program";
    strcpy(firmware.mmcu, "atmega328p");
    firmware.frequency = BOARD_MHZ * 1000000u;
    firmware.vcc = firmware.avcc = firmware.aref = 5000;
    avr = avr_make_mcu_by_name(firmware.mmcu);
    if (avr == NULL) return "this simavr has no ATmega328P";
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    core_reset = avr->reset;
    avr->reset = on_reset;
    avr->sleep = no_sleep;
    byte_out = on_byte;
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS(UART), &flags);
    cup_irq = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(CUP_PORT), CUP_BIT);
    vane_irq = avr_io_getirq(avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0);
    rx_irq = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_OUTPUT), sent, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_OUT_XON), on_xon, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ(UART), UART_IRQ_OUT_XOFF), on_xoff, NULL);
    wire();
    return NULL;
}

uint64_t board_now_us(void) { return avr->cycle / BOARD_MHZ; }

bool board_run_until(uint64_t t_us) {
    while (avr->cycle < t_us * BOARD_MHZ) {
        const int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) return false;
        if (was_reset) wire();
    }
    return true;
}

void board_vane_mv(uint32_t mv) {
    vane_mv = mv;
    avr_raise_irq(vane_irq, mv);
}

void board_cup(double hz) {
    const double now = (double)avr->cycle;
    if (hz > 0.0 && cup.hz > 0.0) {
        cup.start = now - (now - cup.start) * cup.hz / hz; /* the cup does not jump when the wind changes */
    } else {
        cup.start = now;
        cup.edge = 0;
    }
    cup.hz = hz;
    schedule_cup();
}

void board_bounce(unsigned n, double us) {
    cup.bounces = n;
    cup.bounce_cycles = us * BOARD_MHZ;
    cup.start = (double)avr->cycle;
    cup.edge = 0;
    schedule_cup();
}

size_t board_receive(const uint8_t *data, size_t size) {
    size_t taken = 0;
    while (taken < size && rx_size < RX_BYTES) {
        rx[(rx_head + rx_size++) % RX_BYTES] = data[taken++];
    }
    feed();
    return taken;
}
