/* An Arduino with an ATmega328P in simavr, and the sensor wired to it: vane on A0, cup's reed contact on D2. */
#ifndef BOARD_H
#define BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define BOARD_MHZ 16u

/* Load an ELF file and power the board on. Returns NULL on success, else what is wrong. */
const char *board_start(const char *elf, void (*on_byte)(uint64_t t_us, uint8_t byte));

/* Run up to a simulated time in microseconds. False when the processor crashed or stopped for good. */
bool board_run_until(uint64_t t_us);
uint64_t board_now_us(void);

void board_vane_mv(uint32_t mv);          /* voltage on A0 */
void board_cup(double hz);                /* closures a second, 0: the contact stays open */
void board_bounce(unsigned n, double us); /* at each closing and opening, n further blips, toggling after `us` */

/* Bytes to the board's serial input; the number taken (the rest does not fit yet). */
size_t board_receive(const uint8_t *data, size_t size);

#endif
