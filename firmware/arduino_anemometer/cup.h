// Cup anemometer: debounced closures of a reed contact, their frequency, speed and gust. No hardware in here.
#pragma once

#include <stdint.h>

#include "config.h"

// Closures since the cup last stood still. Times are of a microsecond clock that wraps; calm comes long before that.
struct Pulses {
    uint32_t count;
    uint32_t first_us;
    uint32_t last_us;
    uint32_t period_us;  // between the last two; 0 before there are two
};

// The contact as the interrupt sees it. `edge` and `take` must not interrupt each other.
class Contact {
  public:
    // The pin has changed, and now reads closed or open. A closure counts only after the contact stood open for a
    // while: a plain dead time after a closure would count the bounces of an opening as closures.
    void edge(bool closed, uint32_t now_us);

    // What was counted; forgets it after a calm, so that no time is older than that.
    Pulses take(uint32_t now_us);

  private:
    Pulses pulses_ = {};
    uint32_t opened_us_ = 0;
    bool open_ = false;
    bool rested_ = false;  // stood open long enough since the last closure that counted
};

// Speed and gust from what `Contact::take` gave at each report.
class CupSpeed {
  public:
    void report(const Pulses &pulses, uint32_t now_us);

    float speed_mps() const { return speed_mps_; }  // mean over the last `mean_reports`
    float gust_mps() const { return gust_mps_; }    // highest mean over `gust_reports` of the last buckets

    // Whether the mean is over all its time: before, wind that blew at the start would be told for far less.
    bool settled() const { return reports_ > config::mean_reports; }

  private:
    struct Snapshot {
        uint32_t count, last_us;
    };
    float mean_mps(const Pulses &pulses, uint32_t now_us, uint8_t reports) const;

    static constexpr uint8_t RING = config::gust_reports + 1;
    Snapshot ring_[RING] = {};
    uint8_t at_ = 0;
    uint8_t reports_ = 0;  // since the start; stays at the first that is settled
    float speed_mps_ = 0.0f;
    float gust_mps_ = 0.0f;
    float buckets_mps_[config::gust_buckets] = {};
    uint8_t bucket_ = 0;
    uint16_t bucket_reports_ = 0;
};
