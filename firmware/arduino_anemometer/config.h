// Everything that depends on the wiring and on the sensor: pins, calibration, timing. The only file to edit for a boat.
#pragma once

#include <stdint.h>

namespace config {

// --- pins, the same on Uno and Nano ---------------------------------------------------------------------
constexpr uint8_t vane_analog_pin = 0;  // A0: middle of the divider of pull-up and vane
constexpr uint8_t cup_pin = 2;          // D2 (INT0): the cup's reed contact to ground, internal pull-up

// --- vane: 16 reed contacts with a resistor each, in the order 0, 22.5, 45 ... degrees clockwise from its mark ----
constexpr uint32_t vane_pull_up_ohm = 10000;
constexpr uint8_t vane_positions = 16;
constexpr uint32_t vane_ohm[vane_positions] = {
    33000,   // 0
    6570,    // 22.5
    8200,    // 45
    891,     // 67.5
    1000,    // 90
    688,     // 112.5
    2200,    // 135
    1410,    // 157.5
    3900,    // 180
    3140,    // 202.5
    16000,   // 225
    14120,   // 247.5
    120000,  // 270
    42120,   // 292.5
    64900,   // 315
    21880,   // 337.5
};
constexpr int16_t vane_offset_tenths = 0;       // tenths of a degree, added: how far the mark stands right of the bow
constexpr uint16_t vane_tolerance_counts = 25;  // a reading farther from every level means an open or shorted vane

// --- cup: speed = gain * frequency + offset while it turns ------------------------------------------------
constexpr float cup_mps_per_hz = 2.4f / 3.6f;  // one closure a second in 2.4 km/h
constexpr float cup_offset_mps = 0.0f;
constexpr uint32_t debounce_open_us = 2000;  // a closure counts only after the contact stood open for this long
constexpr uint32_t calm_us = 4000000;        // no closure for this long is calm; the slowest speed is gain / 4 s

// --- averages and output ----------------------------------------------------------------------------------
constexpr uint32_t baud = 115200;
constexpr uint32_t report_us = 200000;       // $WIMWV at 5 Hz
constexpr uint32_t vane_sample_us = 20000;   // ten readings in each report
constexpr uint8_t mean_reports = 5;          // speed and direction are means over 1 s
constexpr uint8_t gust_reports = 15;         // a gust is the highest mean over 3 s ...
constexpr uint8_t gust_buckets = 10;         // ... of the last ten
constexpr uint16_t gust_bucket_reports = 300;  // minutes
constexpr uint8_t gust_every_reports = 5;    // $PASVG once a second

}  // namespace config
