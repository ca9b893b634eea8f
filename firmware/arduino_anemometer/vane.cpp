#include "vane.h"

#include <math.h>
#include <stdlib.h>

namespace {

constexpr uint16_t FULL_SCALE = 1023;
constexpr uint16_t LEAST_GAP = 6;  // half of it is what noise and tolerances of the resistors may add up to

constexpr uint16_t counts_of(uint32_t ohm) {
    return (FULL_SCALE * ohm + (ohm + config::vane_pull_up_ohm) / 2) / (ohm + config::vane_pull_up_ohm);
}

constexpr uint16_t level(uint8_t i) { return counts_of(config::vane_ohm[i]); }

constexpr uint16_t distance(uint16_t a, uint16_t b) { return a > b ? a - b : b - a; }

constexpr bool apart(uint8_t i, uint8_t j) {
    return j >= config::vane_positions ? (i + 2 >= config::vane_positions || apart(i + 1, i + 2))
                                       : distance(level(i), level(j)) >= LEAST_GAP && apart(i, j + 1);
}

static_assert(apart(0, 1), "config.h: two vane_ohm give ADC levels less than 6 counts apart");
static_assert(config::vane_sample_us * 255 >= config::report_us, "config.h: vane_sample_us is too short");
static_assert(config::vane_positions == 16, "config.h: the vane has 16 positions");
static_assert(config::vane_offset_tenths > -3600 && config::vane_offset_tenths < 3600, "config.h: vane_offset_tenths");

constexpr uint16_t LEVELS[config::vane_positions] = {
    level(0), level(1), level(2),  level(3),  level(4),  level(5),  level(6),  level(7),
    level(8), level(9), level(10), level(11), level(12), level(13), level(14), level(15),
};

// 120 cos(22.5 degrees * i). With 120 the rounded vectors point within 0.01 degrees of where they should (with 100 it is
// 0.06, which would show in the tenths), and 255 of them fit an int16_t.
constexpr int8_t UNIT = 120;
constexpr int8_t COS[config::vane_positions] = {120,  111,  85,  46,  0, -46, -85, -111,
                                                -120, -111, -85, -46, 0, 46,  85,  111};

constexpr uint8_t quarter_back(uint8_t position) {
    return (position + config::vane_positions - config::vane_positions / 4) % config::vane_positions;
}

constexpr int16_t STEP_TENTHS = 3600 / config::vane_positions;

}  // namespace

int8_t vane_position(uint16_t counts) {
    uint8_t best = 0;
    for (uint8_t i = 1; i < config::vane_positions; ++i) {
        if (distance(counts, LEVELS[i]) < distance(counts, LEVELS[best])) best = i;
    }
    return distance(counts, LEVELS[best]) <= config::vane_tolerance_counts ? int8_t(best) : NO_POSITION;
}

void VaneMean::add(uint16_t counts) {
    Sum &sum = sums_[at_];
    const int8_t position = vane_position(counts);
    if (position == NO_POSITION) {
        if (sum.bad < UINT8_MAX) ++sum.bad;
        return;
    }
    latest_ = position;
    if (sum.good == UINT8_MAX) return;
    ++sum.good;
    sum.x += COS[position];
    sum.y += COS[quarter_back(position)];
}

int16_t VaneMean::report() {
    int32_t x = 0, y = 0;
    uint16_t good = 0, bad = 0;
    for (const Sum &sum : sums_) {
        x += sum.x;
        y += sum.y;
        good += sum.good;
        bad += sum.bad;
    }
    at_ = (at_ + 1) % config::mean_reports;
    sums_[at_] = Sum{};
    if (good == 0 || bad > good) return NO_ANGLE;
    int32_t tenths;
    // Readings from all around cancel: then their mean says nothing, and the last one says a little.
    if (labs(x) + labs(y) < long(UNIT) * good / 10) {
        tenths = int32_t(latest_) * STEP_TENTHS;
    } else {
        tenths = lroundf(atan2f(float(y), float(x)) * float(1800.0 / M_PI));
    }
    return int16_t((tenths + config::vane_offset_tenths + 7200) % 3600);
}
