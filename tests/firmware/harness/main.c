/*
 * simulated-arduino ELF [--real]: the anemometer's firmware in simavr, its serial port on a pseudo terminal.
 *
 * A test tool. It prints `pty PATH`, then reads commands from its standard input and answers each with
 * `ok <simulated us>` or `error <why>`; it ends with its input. In virtual time (the default) simulated time passes in
 * `run` alone, and each line that the board says is also printed as `line <simulated us of its first byte> <text>`.
 * With --real simulated time follows the host's clock, and commands are answered only where they are wrong.
 *
 *   wind MPS DEG    cup and vane in a wind that comes from DEG      hz F        closures of the cup in a second
 *   vane DEG|open|short                                             mv N        millivolts on the vane's pin
 *   bounce N US     N blips of US at each closing and opening       send TEXT   a line to the board's serial port
 *   run MS          let simulated time pass                         quit
 */
#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "board.h"

enum { SLICE_US = 2000, MOST_LAG_US = 500000, LINE_BYTES = 256 };

static const double MPS_PER_HZ = 2.4 / 3.6;
static const double SUPPLY_MV = 5000.0, PULL_UP_OHM = 10000.0;
/* From the sensor's data sheet, and not from the firmware: a wrong level there must not be wrong here too. */
static const double VANE_OHM[16] = {33e3,  6.57e3, 8.2e3, 891.0,   1e3,   688.0,   2.2e3,  1.41e3,
                                    3.9e3, 3.14e3, 16e3,  14.12e3, 120e3, 42.12e3, 64.9e3, 21.88e3};

static FILE *out;
static int master = -1;
static char slave_path[128];
static bool real_time, connected;

static void say_line(uint64_t t_us, uint8_t byte) {
    static char line[LINE_BYTES];
    static size_t size;
    static uint64_t start_us;
    if (size == 0) start_us = t_us;
    if (byte == '\n') {
        fprintf(out, "line %llu %.*s\n", (unsigned long long)start_us, (int)size, line);
        size = 0;
    } else if (byte != '\r' && size < sizeof line) {
        line[size++] = (char)byte;
    }
}

static void on_byte(uint64_t t_us, uint8_t byte) {
    if (!real_time) say_line(t_us, byte);
    /* A full terminal loses bytes, as a serial adapter does whose reader is too slow. */
    if (connected && write(master, &byte, 1) < 0 && errno != EAGAIN && errno != EIO) perror("simulated-arduino: pty");
}

/* Without a reader bytes must be lost: the kernel would keep them, and the next reader would get stale ones. */
static void look_for_reader(void) {
    struct pollfd look = {.fd = master, .events = 0};
    const bool was = connected;
    connected = poll(&look, 1, 0) >= 0 && !(look.revents & POLLHUP);
    if (was && !connected) {
        const int slave = open(slave_path, O_RDWR | O_NOCTTY | O_NONBLOCK);
        if (slave >= 0) {
            tcflush(slave, TCIFLUSH);
            close(slave);
        }
    }
}

static void serial_input(void) {
    uint8_t data[64];
    if (!connected) return;
    const ssize_t size = read(master, data, sizeof data);
    if (size > 0) board_receive(data, (size_t)size);
}

/* In slices, so that what comes in on the serial port arrives in between. */
static bool advance(uint64_t until_us) {
    uint64_t at_us = board_now_us();
    while (at_us < until_us) {
        at_us = until_us - at_us > SLICE_US ? at_us + SLICE_US : until_us;
        look_for_reader();
        serial_input();
        if (!board_run_until(at_us)) return false;
    }
    return true;
}

static void set_vane(double deg) {
    const long position = lround(deg / 22.5) % 16;
    const double ohm = VANE_OHM[(position + 16) % 16];
    board_vane_mv((uint32_t)lround(SUPPLY_MV * ohm / (ohm + PULL_UP_OHM)));
}

static bool in_range(double value, double low, double high) { return value >= low && value <= high; }

/* NULL when the command was done, else what is wrong with it. */
static const char *command(char *line, bool *quit) {
    double a, b;
    char word[16];
    int end = 0;
    if (sscanf(line, "wind %lf %lf%n", &a, &b, &end) == 2 && line[end] == '\0') {
        if (!in_range(a, 0.0, 100.0) || !in_range(b, -720.0, 720.0)) return "wind MPS DEG: 0 to 100 m/s";
        board_cup(a / MPS_PER_HZ);
        set_vane(b);
    } else if (sscanf(line, "hz %lf%n", &a, &end) == 1 && line[end] == '\0') {
        if (!in_range(a, 0.0, 1000.0)) return "hz F: 0 to 1000";
        board_cup(a);
    } else if (sscanf(line, "vane %lf%n", &a, &end) == 1 && line[end] == '\0') {
        if (!in_range(a, -720.0, 720.0)) return "vane DEG";
        set_vane(a);
    } else if (sscanf(line, "vane %15s%n", word, &end) == 1 && line[end] == '\0') {
        if (strcmp(word, "open") != 0 && strcmp(word, "short") != 0) return "vane DEG, open or short";
        board_vane_mv(word[0] == 'o' ? (uint32_t)SUPPLY_MV : 0);
    } else if (sscanf(line, "mv %lf%n", &a, &end) == 1 && line[end] == '\0') {
        if (!in_range(a, 0.0, SUPPLY_MV)) return "mv N: 0 to 5000";
        board_vane_mv((uint32_t)lround(a));
    } else if (sscanf(line, "bounce %lf %lf%n", &a, &b, &end) == 2 && line[end] == '\0') {
        if (!in_range(a, 0.0, 20.0) || !in_range(b, 0.0, 1000.0)) return "bounce N US: 0 to 20, 0 to 1000 us";
        board_bounce((unsigned)a, b);
    } else if (strncmp(line, "send ", 5) == 0) {
        const size_t size = strlen(line + 5);
        if (board_receive((const uint8_t *)line + 5, size) != size || board_receive((const uint8_t *)"\r\n", 2) != 2) {
            return "send: the board's input is full";
        }
    } else if (sscanf(line, "run %lf%n", &a, &end) == 1 && line[end] == '\0' && !real_time) {
        if (!in_range(a, 0.0, 1e7)) return "run MS: 0 to 1e7";
        if (!advance(board_now_us() + (uint64_t)llround(1000.0 * a))) return "the processor stopped or crashed";
    } else if (strcmp(line, "quit") == 0) {
        *quit = true;
    } else {
        return "unknown command";
    }
    return NULL;
}

/* Take in what standard input has, and do every whole line of it. False at its end, or after `quit`. */
static bool commands(void) {
    static char buffer[4096];
    static size_t size;
    const ssize_t got = read(STDIN_FILENO, buffer + size, sizeof buffer - size);
    if (got <= 0) return got < 0 && (errno == EAGAIN || errno == EINTR);
    size += (size_t)got;
    char *from = buffer, *newline;
    bool quit = false;
    while (!quit && (newline = memchr(from, '\n', size - (size_t)(from - buffer))) != NULL) {
        *newline = '\0';
        const char *wrong = command(from, &quit);
        if (wrong != NULL) {
            fprintf(out, "error %s\n", wrong);
        } else if (!real_time) {
            fprintf(out, "ok %llu\n", (unsigned long long)board_now_us());
        }
        fflush(out);
        from = newline + 1;
    }
    size -= (size_t)(from - buffer);
    memmove(buffer, from, size);
    return !quit && size < sizeof buffer;
}

static uint64_t host_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u;
}

static int follow_the_clock(void) {
    uint64_t zero_us = host_us();
    for (;;) {
        uint64_t due_us = host_us() - zero_us;
        if (due_us > board_now_us() + MOST_LAG_US) { /* the host stalled: stand still with it, do not rush after it */
            zero_us += due_us - board_now_us();
            due_us = board_now_us();
        }
        if (!advance(due_us)) {
            fprintf(stderr, "simulated-arduino: the processor stopped or crashed\n");
            return 1;
        }
        struct pollfd ready = {.fd = STDIN_FILENO, .events = POLLIN};
        if (poll(&ready, 1, SLICE_US / 1000) > 0 && !commands()) return 0;
    }
}

static const char *open_terminal(void) {
    int slave;
    struct termios raw;
    if (openpty(&master, &slave, slave_path, NULL, NULL) != 0) return "no pseudo terminal to be had";
    if (tcgetattr(slave, &raw) != 0) return "the pseudo terminal has no attributes";
    cfmakeraw(&raw);
    if (tcsetattr(slave, TCSANOW, &raw) != 0) return "the pseudo terminal cannot be made raw";
    close(slave);
    return fcntl(master, F_SETFL, O_NONBLOCK) == 0 ? NULL : "the pseudo terminal cannot be made non-blocking";
}

int main(int argc, char **argv) {
    if (argc < 2 || argc > 3 || (argc == 3 && strcmp(argv[2], "--real") != 0)) {
        fprintf(stderr, "usage: simulated-arduino ELF [--real]\n");
        return 2;
    }
    /* The library prints to standard output: what it says goes to standard error, the protocol stays alone. */
    out = fdopen(dup(STDOUT_FILENO), "w");
    dup2(STDERR_FILENO, STDOUT_FILENO);
    if (out == NULL) return 1;
    signal(SIGPIPE, SIG_IGN);
    real_time = argc == 3;
    const char *wrong = access(argv[1], R_OK) == 0 ? board_start(argv[1], on_byte) : "cannot be read";
    if (wrong == NULL) wrong = open_terminal();
    if (wrong != NULL) {
        fprintf(stderr, "simulated-arduino: %s: %s\n", argv[1], wrong);
        return 1;
    }
    fprintf(out, "pty %s\n", slave_path);
    fflush(out);
    if (real_time) return follow_the_clock();
    while (commands()) {
    }
    return 0;
}
