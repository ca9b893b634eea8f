#include "sentence.h"

#include <string.h>

namespace {

constexpr char HEX_DIGITS[] = "0123456789ABCDEF";
constexpr char QUERY[] = "PASVQ,";
constexpr uint8_t QUERY_SIZE = sizeof QUERY - 1;
constexpr float HIGHEST_MPS = 999.0f;

uint32_t hundredths(float mps) {
    if (!(mps > 0.0f)) return 0;
    return uint32_t((mps < HIGHEST_MPS ? mps : HIGHEST_MPS) * 100.0f + 0.5f);
}

}  // namespace

Sentence::Sentence(const char *head) {
    buffer_[size_++] = '$';
    while (*head) put(*head++);
}

void Sentence::put(char c) {
    constexpr uint8_t TAIL = 5;  // *hh, carriage return, line feed
    if (size_ >= LONGEST - TAIL) return;
    buffer_[size_++] = c;
    checksum_ ^= uint8_t(c);
}

Sentence &Sentence::text(const char *field) {
    put(',');
    while (*field) put(*field++);
    return *this;
}

Sentence &Sentence::number(uint32_t value) { return fixed(value, 0); }

Sentence &Sentence::fixed(uint32_t value, uint8_t digits) {
    char reversed[11];  // ten digits and a point
    uint8_t size = 0;
    for (uint8_t place = 0; value != 0 || place <= digits; ++place) {
        if (place == digits && digits != 0) reversed[size++] = '.';
        reversed[size++] = char('0' + value % 10);
        value /= 10;
    }
    put(',');
    while (size != 0) put(reversed[--size]);
    return *this;
}

Sentence &Sentence::end() {
    buffer_[size_++] = '*';
    buffer_[size_++] = HEX_DIGITS[checksum_ >> 4];
    buffer_[size_++] = HEX_DIGITS[checksum_ & 15];
    buffer_[size_++] = '\r';
    buffer_[size_++] = '\n';
    return *this;
}

Sentence wind_sentence(int16_t angle_tenths, float speed_mps) {
    const bool valid = angle_tenths >= 0;
    Sentence sentence("WIMWV");
    if (valid) {
        sentence.fixed(uint32_t(angle_tenths), 1);
    } else {
        sentence.text("");
    }
    return sentence.text("R").fixed(hundredths(speed_mps), 2).text("M").text(valid ? "A" : "V").end();
}

Sentence gust_sentence(float gust_mps) { return Sentence("PASVG").fixed(hundredths(gust_mps), 2).text("M").end(); }

Sentence version_sentence(const char *start) {
    return Sentence("PASVV").text(FIRMWARE_NAME).text(FIRMWARE_VERSION).text(start).end();
}

Sentence raw_sentence(uint16_t counts, int8_t position, uint32_t closures) {
    Sentence sentence("PASVR");
    sentence.number(counts);
    if (position >= 0) {
        sentence.number(uint32_t(position));
    } else {
        sentence.text("");
    }
    return sentence.number(closures).end();
}

Request RequestReader::feed(char c) {
    if (c == '$') {
        lost_ = false;
        size_ = 0;
        return Request::NONE;
    }
    if (lost_) return Request::NONE;
    if (c != '\r' && c != '\n') {
        if (size_ < LONGEST) {
            line_[size_++] = c;
        } else {
            lost_ = true;
        }
        return Request::NONE;
    }
    lost_ = true;
    if (size_ < QUERY_SIZE + 1 || memcmp(line_, QUERY, QUERY_SIZE) != 0) return Request::NONE;
    if (size_ != QUERY_SIZE + 1) {
        uint8_t checksum = 0;
        for (uint8_t i = 0; i <= QUERY_SIZE; ++i) checksum ^= uint8_t(line_[i]);
        const char *tail = line_ + QUERY_SIZE + 1;
        if (size_ != QUERY_SIZE + 4 || tail[0] != '*' || tail[1] != HEX_DIGITS[checksum >> 4] ||
            tail[2] != HEX_DIGITS[checksum & 15]) {
            return Request::NONE;
        }
    }
    switch (line_[QUERY_SIZE]) {
        case 'V': return Request::VERSION;
        case 'R': return Request::RAW;
        default: return Request::NONE;
    }
}
