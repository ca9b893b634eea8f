// The firmware's own headers and sources, compiled for the host under sanitizers. `test_logic NAME` runs one test.
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>

#include "cup.h"
#include "sentence.h"
#include "vane.h"

namespace {

int failures = 0;

#define CHECK(condition)                                                       \
    do {                                                                       \
        if (!(condition)) {                                                    \
            ++failures;                                                        \
            std::printf("%s:%d: %s\n", __FILE__, __LINE__, #condition);        \
        }                                                                      \
    } while (0)

std::string text(const Sentence &sentence) { return std::string(sentence.data(), sentence.size()); }

int16_t mean_of(VaneMean &mean, uint16_t counts, int readings) {
    for (int i = 0; i < readings; ++i) mean.add(counts);
    return mean.report();
}

// The 10-bit readings that a 10 k pull-up gives with the resistors of the data sheet, worked out by hand.
constexpr uint16_t READINGS[16] = {785, 406, 461, 84, 93, 66, 184, 126, 287, 244, 630, 599, 944, 827, 887, 702};

void positions() {
    for (int i = 0; i < 16; ++i) {
        for (int noise = -3; noise <= 3; ++noise) CHECK(vane_position(uint16_t(READINGS[i] + noise)) == i);
    }
    for (const int bad : {0, 20, 530, 1000, 1023}) CHECK(vane_position(uint16_t(bad)) == NO_POSITION);
    for (int counts = 0; counts <= 1023; ++counts) {
        const int8_t position = vane_position(uint16_t(counts));
        CHECK(position >= NO_POSITION && position < 16);
    }
}

void each_direction_is_exact() {
    for (int i = 0; i < 16; ++i) {
        VaneMean mean;
        for (int report = 0; report < 12; ++report) CHECK(mean_of(mean, READINGS[i], 10) == i * 225);
    }
}

void mean_across_north() {
    VaneMean mean;
    for (int report = 0; report < 20; ++report) {
        for (int i = 0; i < 10; ++i) mean.add(READINGS[i % 2 ? 1 : 15]);  // 22.5 and 337.5
        CHECK(mean.report() == 0);
    }
    VaneMean skewed;
    int16_t tenths = NO_ANGLE;
    for (int report = 0; report < 5; ++report) {
        for (int i = 0; i < 9; ++i) skewed.add(READINGS[i % 3 ? 15 : 1]);  // twice as long at 337.5
        tenths = skewed.report();
    }
    CHECK(tenths > 3495 && tenths < 3555);
}

void readings_that_cancel_give_the_last_one() {
    VaneMean mean;
    for (int i = 0; i < 5; ++i) {
        mean.add(READINGS[4]);
        mean.add(READINGS[12]);
    }
    CHECK(mean.report() == 2700);
}

void a_vane_that_is_open_or_shorted_has_no_angle() {
    for (const uint16_t bad : {uint16_t(1023), uint16_t(0)}) {
        VaneMean mean;
        CHECK(mean_of(mean, bad, 10) == NO_ANGLE);
        int16_t tenths = NO_ANGLE;
        for (int report = 0; report < 5; ++report) tenths = mean_of(mean, READINGS[3], 10);
        CHECK(tenths == 675);
        CHECK(mean_of(mean, bad, 10) == 675);  // 0.2 s of it is a glitch
        CHECK(mean_of(mean, bad, 10) == 675);
        CHECK(mean_of(mean, bad, 10) == NO_ANGLE);
    }
    VaneMean nothing_read;
    CHECK(nothing_read.report() == NO_ANGLE);
}

void more_readings_than_a_report_can_hold() {
    VaneMean mean;
    int16_t tenths = NO_ANGLE;
    for (int report = 0; report < 6; ++report) tenths = mean_of(mean, READINGS[15], 1000);
    CHECK(tenths == 3375);
    CHECK(mean_of(mean, 1023, 100000) == 3375);
}

// Turns of a cup: closed for one half, open for the other, with blips at both edges.
struct Cup {
    Contact contact;
    double at_us = 1e6;
    void turn(double period_us, int blips, double blip_us) {
        for (const bool closing : {true, false}) {
            const double from_us = at_us + (closing ? 0.0 : 0.5 * period_us);
            for (int i = 0; i <= 2 * blips; ++i) {
                contact.edge(closing == (i % 2 == 0), uint32_t(uint64_t(from_us + i * blip_us)));
            }
        }
        at_us += period_us;
    }
    uint32_t closures() { return contact.take(uint32_t(uint64_t(at_us))).count; }
};

void bouncing_contacts_count_once() {
    for (const double hz : {0.5, 3.0, 27.0, 90.0}) {
        for (const int blips : {0, 1, 4, 10}) {
            for (const double blip_us : {1.0, 10.0, 50.0, 140.0}) {
                Cup cup;
                cup.contact.edge(false, 0);
                for (int i = 0; i < 50; ++i) cup.turn(1e6 / hz, blips, blip_us);
                CHECK(cup.closures() == 50);
            }
        }
    }
}

void blips_too_brief_to_be_seen() {
    Contact contact;
    contact.edge(false, 0);
    uint32_t t_us = 10000;
    for (int i = 0; i < 20; ++i, t_us += 20000) {
        contact.edge(false, t_us);        // it closed and opened again before the interrupt looked
        contact.edge(true, t_us + 30);    // closed for good
        contact.edge(true, t_us + 60);    // opened and closed again unseen
        contact.edge(false, t_us + 9000);
        contact.edge(false, t_us + 9030);
    }
    CHECK(contact.take(t_us).count == 20);
    // A spike alone is no closure.
    Contact quiet;
    quiet.edge(false, 0);
    for (uint32_t spike_us = 5000; spike_us < 100000; spike_us += 5000) quiet.edge(false, spike_us);
    CHECK(quiet.take(100000).count == 0);
}

void the_clock_wraps() {
    Contact contact;
    uint32_t t_us = 0xFFFFFFFFu - 250000;
    contact.edge(false, t_us);
    for (int i = 0; i < 50; ++i, t_us += 10000) {
        contact.edge(true, t_us + 5000);
        contact.edge(false, t_us + 7000);
    }
    const Pulses pulses = contact.take(t_us);
    CHECK(pulses.count == 50 && pulses.period_us == 10000);
}

void calm_forgets() {
    Cup cup;
    cup.contact.edge(false, 0);
    for (int i = 0; i < 3; ++i) cup.turn(1e5, 0, 0.0);
    const uint32_t last_us = uint32_t(cup.at_us - 1e5);
    CHECK(cup.contact.take(last_us + config::calm_us).count == 3);
    CHECK(cup.contact.take(last_us + config::calm_us + 1).count == 0);
    cup.at_us += 1e7;
    cup.turn(1e5, 0, 0.0);
    CHECK(cup.closures() == 1);
}

// Reports of a cup that turns steadily: each edge comes at its time, however the reports fall between them.
float settled_mps(double hz, double seconds, CupSpeed &speed) {
    Contact contact;
    contact.edge(false, 0);
    double edge_us = 1e6;
    bool closing = true;
    for (double t_us = 1e6; t_us <= 1e6 + seconds * 1e6; t_us += config::report_us) {
        for (; hz > 0.0 && edge_us <= t_us; edge_us += 0.5e6 / hz, closing = !closing) {
            contact.edge(closing, uint32_t(uint64_t(edge_us)));
        }
        speed.report(contact.take(uint32_t(uint64_t(t_us))), uint32_t(uint64_t(t_us)));
    }
    return speed.speed_mps();
}

void speeds() {
    for (const double hz : {0.5, 0.77, 1.0, 2.3, 10.0, 45.0, 90.0}) {
        CupSpeed speed;
        const float mps = settled_mps(hz, 12.0, speed);
        CHECK(std::fabs(mps - hz * 2.4 / 3.6) < 0.005);
        CHECK(std::fabs(speed.gust_mps() - mps) < 0.01f);
    }
    CupSpeed still;
    CHECK(settled_mps(0.0, 5.0, still) == 0.0f);
}

void a_start_in_wind_is_not_told_for_a_calm() {
    Cup cup;
    CupSpeed speed;
    cup.contact.edge(false, 0);
    for (int report = 1; report <= 20; ++report) {
        for (int turn = 0; turn < 3; ++turn) cup.turn(1e6 / 15.0, 0, 0.0);
        speed.report(cup.contact.take(uint32_t(cup.at_us)), uint32_t(cup.at_us));
        CHECK(speed.settled() == (report > config::mean_reports));
        CHECK(!speed.settled() || std::fabs(speed.speed_mps() - 10.0f) < 0.01f);
    }
}

void an_overdue_closure_lowers_the_speed() {
    Cup cup;
    CupSpeed speed;
    cup.contact.edge(false, 0);
    for (int i = 0; i < 40; ++i) {
        for (int turn = 0; turn < 2; ++turn) cup.turn(1e5, 0, 0.0);
        speed.report(cup.contact.take(uint32_t(cup.at_us)), uint32_t(cup.at_us));
    }
    float before_mps = speed.speed_mps();
    CHECK(std::fabs(before_mps - 6.6667f) < 0.01f);
    for (int report = 0; report < 25; ++report) {
        cup.at_us += config::report_us;
        speed.report(cup.contact.take(uint32_t(cup.at_us)), uint32_t(cup.at_us));
        CHECK(speed.speed_mps() <= before_mps);
        before_mps = speed.speed_mps();
    }
    CHECK(before_mps == 0.0f);
}

void a_gust_is_kept_for_ten_minutes() {
    Cup cup;
    CupSpeed speed;
    cup.contact.edge(false, 0);
    const auto blow = [&](double hz, double seconds) {
        const double end_us = cup.at_us + seconds * 1e6;
        double report_us = cup.at_us + config::report_us;
        while (cup.at_us < end_us) {
            cup.turn(1e6 / hz, 0, 0.0);
            while (report_us <= cup.at_us) {
                speed.report(cup.contact.take(uint32_t(uint64_t(cup.at_us))), uint32_t(uint64_t(cup.at_us)));
                report_us += config::report_us;
            }
        }
    };
    blow(5.0, 30.0);
    blow(20.0, 4.0);
    blow(5.0, 8.5 * 60.0);
    CHECK(std::fabs(speed.gust_mps() - 13.33f) < 0.1f);
    CHECK(std::fabs(speed.speed_mps() - 3.33f) < 0.01f);
    blow(5.0, 2.5 * 60.0);
    CHECK(std::fabs(speed.gust_mps() - 3.33f) < 0.05f);
    CupSpeed flick;  // two quick closures after a calm are no gust
    Cup hand;
    hand.contact.edge(false, 0);
    flick.report(hand.contact.take(uint32_t(hand.at_us)), uint32_t(hand.at_us));
    for (int i = 0; i < 3; ++i) hand.turn(1e4, 0, 0.0);
    flick.report(hand.contact.take(uint32_t(hand.at_us)), uint32_t(hand.at_us));
    CHECK(flick.gust_mps() < 0.5f);
}

void sentences() {
    CHECK(text(wind_sentence(2148, 0.1f)) == "$WIMWV,214.8,R,0.10,M,A*1E\r\n");
    CHECK(text(wind_sentence(0, 0.0f)) == "$WIMWV,0.0,R,0.00,M,A*10\r\n");
    CHECK(text(wind_sentence(225, 60.0f)) == "$WIMWV,22.5,R,60.00,M,A*13\r\n");
    CHECK(text(wind_sentence(NO_ANGLE, 3.456f)) == "$WIMWV,,R,3.46,M,V*28\r\n");
    CHECK(text(wind_sentence(3599, 1e9f)) == "$WIMWV,359.9,R,999.00,M,A*1F\r\n");
    CHECK(text(wind_sentence(0, NAN)) == text(wind_sentence(0, 0.0f)));
    CHECK(text(wind_sentence(0, -1.0f)) == text(wind_sentence(0, 0.0f)));
    CHECK(text(gust_sentence(6.125f)) == "$PASVG,6.13,M*04\r\n");
    CHECK(text(raw_sentence(1023, NO_POSITION, 4294967295u)) == "$PASVR,1023,,4294967295*67\r\n");
    CHECK(text(raw_sentence(84, 3, 0)) == "$PASVR,84,3,0*65\r\n");
    CHECK(text(version_sentence("reset")).find("$PASVV,arduino_anemometer," FIRMWARE_VERSION ",reset*") == 0);
    Sentence longest("PASVX");
    for (int i = 0; i < 40; ++i) longest.text("123456");
    longest.end();
    CHECK(longest.size() == 82 && text(longest).substr(80) == "\r\n");
}

Request ask(RequestReader &reader, const char *line) {
    Request found = Request::NONE;
    for (; *line; ++line) {
        const Request request = reader.feed(*line);
        if (request != Request::NONE) found = request;
    }
    return found;
}

void requests() {
    RequestReader reader;
    CHECK(ask(reader, "$PASVQ,V*3F\r\n") == Request::VERSION);
    CHECK(ask(reader, "$PASVQ,R*3B\r\n") == Request::RAW);
    CHECK(ask(reader, "$PASVQ,V\n") == Request::VERSION);
    CHECK(ask(reader, "noise$GPGGA$PASVQ,R\r") == Request::RAW);
    for (const char *bad : {"$PASVQ,V*3E\r\n", "$PASVQ,V*3\r\n", "$PASVQ,X\r\n", "PASVQ,V\r\n", "$PASVQ\r\n", "$PASVQ,VV\r\n",
                            "$\r\n", "\r\n", "$PASVQ,V*3F*3F\r\n", "$PASVQ,V                         \r\n"}) {
        CHECK(ask(reader, bad) == Request::NONE);
    }
    uint32_t state = 1;
    for (int i = 0; i < 200000; ++i) {
        state = state * 1664525u + 1013904223u;
        reader.feed(char(state >> 24));
    }
    CHECK(ask(reader, "\n$PASVQ,V\n") == Request::VERSION);
}

struct Test {
    const char *name;
    void (*run)();
};
#define TEST(name) {#name, name}
const Test TESTS[] = {
    TEST(positions),
    TEST(each_direction_is_exact),
    TEST(mean_across_north),
    TEST(readings_that_cancel_give_the_last_one),
    TEST(a_vane_that_is_open_or_shorted_has_no_angle),
    TEST(more_readings_than_a_report_can_hold),
    TEST(bouncing_contacts_count_once),
    TEST(blips_too_brief_to_be_seen),
    TEST(the_clock_wraps),
    TEST(calm_forgets),
    TEST(speeds),
    TEST(a_start_in_wind_is_not_told_for_a_calm),
    TEST(an_overdue_closure_lowers_the_speed),
    TEST(a_gust_is_kept_for_ten_minutes),
    TEST(sentences),
    TEST(requests),
};

}  // namespace

int main(int argc, char **argv) {
    bool known = false;
    for (const Test &test : TESTS) {
        if (argc == 2 && std::strcmp(argv[1], "--list") == 0) {
            std::printf("%s\n", test.name);
        } else if (argc == 2 && std::strcmp(argv[1], test.name) == 0) {
            test.run();
        } else {
            continue;
        }
        known = true;
    }
    return !known || failures != 0;
}
