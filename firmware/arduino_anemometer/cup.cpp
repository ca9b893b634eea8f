#include "cup.h"

static_assert(config::gust_reports >= config::mean_reports, "config.h: gust_reports must not be below mean_reports");
static_assert(config::calm_us <= 60000000UL, "config.h: calm_us must be a minute at most");

void Contact::edge(bool closed, uint32_t now_us) {
    // A blip can be over before the interrupt looks, so that open may follow open: the rest before it was still a rest.
    if (open_ && now_us - opened_us_ >= config::debounce_open_us) rested_ = true;
    open_ = !closed;
    if (open_) {
        opened_us_ = now_us;
        return;
    }
    if (!rested_) return;
    rested_ = false;
    if (pulses_.count == 0) {
        pulses_.first_us = now_us;
    } else {
        pulses_.period_us = now_us - pulses_.last_us;
    }
    pulses_.last_us = now_us;
    ++pulses_.count;
}

Pulses Contact::take(uint32_t now_us) {
    if (pulses_.count != 0 && now_us - pulses_.last_us > config::calm_us) pulses_ = Pulses{};
    return pulses_;
}

// Periods are timed, not counted in a gate: one count in a gate of 1 s would be 0.67 m/s.
float CupSpeed::mean_mps(const Pulses &pulses, uint32_t now_us, uint8_t reports) const {
    if (pulses.period_us == 0) return 0.0f;
    const Snapshot &old = ring_[(at_ + RING - reports) % RING];
    uint32_t periods, span_us;
    if (old.count == 0) {
        periods = pulses.count - 1;
        span_us = pulses.last_us - pulses.first_us;
        // It stood still when this window began: two quick closures are not yet a gust.
        const uint32_t window_us = reports * config::report_us;
        if (span_us < window_us) span_us = window_us;
    } else {
        periods = pulses.count - old.count;
        span_us = pulses.last_us - old.last_us;
    }
    if (periods == 0) {
        periods = 1;
        span_us = pulses.period_us;
    }
    // An overdue closure says that the wind has dropped, even before it comes.
    const float period_us = float(span_us) / float(periods);
    const float waited_us = float(now_us - pulses.last_us);
    const float late_us = waited_us > period_us ? waited_us - period_us : 0.0f;
    const float hz = 1e6f * float(periods) / (float(span_us) + late_us);
    return config::cup_mps_per_hz * hz + config::cup_offset_mps;
}

void CupSpeed::report(const Pulses &pulses, uint32_t now_us) {
    if (!settled()) ++reports_;
    if (pulses.count == 0) {
        for (Snapshot &snapshot : ring_) snapshot = Snapshot{};
    }
    speed_mps_ = mean_mps(pulses, now_us, config::mean_reports);
    const float gust_mps = mean_mps(pulses, now_us, config::gust_reports);
    if (gust_mps > buckets_mps_[bucket_]) buckets_mps_[bucket_] = gust_mps;
    gust_mps_ = 0.0f;
    for (const float bucket_mps : buckets_mps_) {
        if (bucket_mps > gust_mps_) gust_mps_ = bucket_mps;
    }
    if (++bucket_reports_ >= config::gust_bucket_reports) {
        bucket_reports_ = 0;
        bucket_ = (bucket_ + 1) % config::gust_buckets;
        buckets_mps_[bucket_] = 0.0f;
    }
    ring_[at_] = Snapshot{pulses.count, pulses.last_us};
    at_ = (at_ + 1) % RING;
}
