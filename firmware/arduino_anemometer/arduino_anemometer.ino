// Cup and vane to NMEA 0183 on an ATmega328P (Arduino Uno or Nano): $WIMWV five times a second.
// This file alone touches the hardware; pins and calibration are in config.h.

#include <avr/sleep.h>
#include <avr/wdt.h>

#include "config.h"
#include "cup.h"
#include "sentence.h"
#include "vane.h"

namespace {

Contact contact;  // the interrupt's; elsewhere only with interrupts off
VaneMean vane;
CupSpeed cup;
RequestReader requests;
uint16_t counts;
uint32_t closures;
uint8_t reset_flags __attribute__((section(".noinit")));
uint32_t sample_due_us;
uint32_t report_due_us;
uint8_t reports_to_gust = config::gust_every_reports;

void on_cup() { contact.edge(digitalRead(config::cup_pin) == LOW, micros()); }

void say(const Sentence &sentence) { Serial.write(sentence.data(), sentence.size()); }

const char *start_name() {
    if (reset_flags & _BV(WDRF)) return "watchdog";
    if (reset_flags & _BV(BORF)) return "brown-out";
    if (reset_flags & _BV(EXTRF)) return "reset";
    return "power-on";
}

bool due(uint32_t now_us, uint32_t &due_us, uint32_t period_us) {
    if (int32_t(now_us - due_us) < 0) return false;
    due_us += period_us;
    return true;
}

void report() {
    noInterrupts();
    const uint32_t now_us = micros();
    const Pulses pulses = contact.take(now_us);
    interrupts();
    closures = pulses.count;
    cup.report(pulses, now_us);
    const int16_t angle_tenths = vane.report();
    say(wind_sentence(cup.settled() ? angle_tenths : NO_ANGLE, cup.speed_mps()));
    if (--reports_to_gust == 0) {
        reports_to_gust = config::gust_every_reports;
        say(gust_sentence(cup.gust_mps()));
    }
}

void answer(Request request) {
    switch (request) {
        case Request::VERSION: say(version_sentence("request")); break;
        case Request::RAW: say(raw_sentence(counts, vane_position(counts), closures)); break;
        case Request::NONE: break;
    }
}

}  // namespace

// After a watchdog reset the watchdog runs on with its shortest time: stop it before the C runtime starts.
extern "C" void stop_watchdog() __attribute__((naked, used, section(".init3")));
extern "C" void stop_watchdog() {
    reset_flags = MCUSR;
    MCUSR = 0;
    wdt_disable();
}

void setup() {
    pinMode(config::cup_pin, INPUT_PULLUP);
    Serial.begin(config::baud);
    on_cup();
    attachInterrupt(digitalPinToInterrupt(config::cup_pin), on_cup, CHANGE);
    set_sleep_mode(SLEEP_MODE_IDLE);
    wdt_enable(WDTO_500MS);
    say(version_sentence(start_name()));
    sample_due_us = report_due_us = micros() + config::report_us;
}

void loop() {
    wdt_reset();
    const uint32_t now_us = micros();
    if (due(now_us, sample_due_us, config::vane_sample_us)) {
        counts = uint16_t(analogRead(config::vane_analog_pin));
        vane.add(counts);
    }
    if (due(now_us, report_due_us, config::report_us)) report();
    while (Serial.available() > 0) answer(requests.feed(char(Serial.read())));
    sleep_mode();  // the core's millisecond timer wakes it, the cup and the serial port do too
}
