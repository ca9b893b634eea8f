// Wind vane: ADC counts to one of 16 positions, and the circular mean of positions. No hardware in here.
#pragma once

#include <stdint.h>

#include "config.h"

constexpr int8_t NO_POSITION = -1;
constexpr int16_t NO_ANGLE = -1;

// Position 0..15 of a reading of 0..1023 counts; NO_POSITION where no level is near: the vane is open or shorted.
int8_t vane_position(uint16_t counts);

// Mean direction over the last `mean_reports` reports. Unit vectors are summed, so that it runs across north.
class VaneMean {
  public:
    void add(uint16_t counts);

    // Close a report. Tenths of a degree, 0..3599, clockwise from the bow; NO_ANGLE where less than half of the
    // readings were a position.
    int16_t report();

  private:
    struct Sum {
        int16_t x, y;
        uint8_t good, bad;
    };
    Sum sums_[config::mean_reports] = {};
    uint8_t at_ = 0;
    int8_t latest_ = NO_POSITION;
};
