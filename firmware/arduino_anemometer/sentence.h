// NMEA 0183: the sentences that go out, and the requests that come in. No hardware in here.
#pragma once

#include <stdint.h>

#define FIRMWARE_NAME "arduino_anemometer"
#define FIRMWARE_VERSION "1.0.1"

// One sentence, built field by field. What would overrun the 82 characters of NMEA 0183 is left out.
class Sentence {
  public:
    explicit Sentence(const char *head);  // such as "WIMWV"; `$` is put before it

    Sentence &text(const char *field);              // a comma and the text
    Sentence &number(uint32_t value);               // a comma and a whole number
    Sentence &fixed(uint32_t value, uint8_t digits);  // a comma and value / 10^digits, such as 3.07
    Sentence &end();                                // `*hh`, carriage return, line feed

    const char *data() const { return buffer_; }
    uint8_t size() const { return size_; }

  private:
    static constexpr uint8_t LONGEST = 82;
    void put(char c);
    char buffer_[LONGEST];
    uint8_t size_ = 0;
    uint8_t checksum_ = 0;
};

// $WIMWV,<degrees>,R,<m/s>,M,A*hh. Without an angle (negative tenths) the field is empty and the status V.
Sentence wind_sentence(int16_t angle_tenths, float speed_mps);
// $PASVG,<gust m/s>,M*hh
Sentence gust_sentence(float gust_mps);
// $PASVV,<name>,<version>,<what made it start>*hh
Sentence version_sentence(const char *start);
// $PASVR,<counts of the vane>,<position, empty where none>,<closures>*hh: for wiring and calibration
Sentence raw_sentence(uint16_t counts, int8_t position, uint32_t closures);

enum class Request : uint8_t { NONE, VERSION, RAW };

// Reads $PASVQ,V and $PASVQ,R byte by byte. A checksum must be right where there is one; a person may leave it out.
class RequestReader {
  public:
    Request feed(char c);

  private:
    static constexpr uint8_t LONGEST = 15;
    char line_[LONGEST];
    uint8_t size_ = 0;
    bool lost_ = true;  // until the next `$`
};
