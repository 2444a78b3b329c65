// The message of this bridge: one UDP datagram of 128 bytes, little endian, in DRFL's own units.
// The layout is documented in src/seerob/protocols/robots/doosan_drfl.py and docs/sources/drfl.md.
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace bridge {

constexpr std::size_t kLength = 128;
constexpr std::uint16_t kVersion = 1;
constexpr std::uint32_t kTorques = 1;

struct Sample {
    std::uint32_t number = 0;
    std::uint32_t flags = 0;
    double time = 0.0;                           // s, the controller's
    std::array<float, 6> positions{};            // deg
    std::array<float, 6> speeds{};               // deg/s
    std::array<float, 6> torques{};              // N m
    std::array<float, 6> external{};             // N m
    std::uint8_t mode = 0;
    std::uint8_t state = 0;
    std::uint16_t control = 0;
};

// CRC-32 of IEEE 802.3, bit by bit: 124 bytes a thousand times a second need no table.
inline std::uint32_t crc32(const std::uint8_t* data, std::size_t length) {
    std::uint32_t crc = 0xFFFFFFFFu;
    for (std::size_t i = 0; i < length; ++i) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return ~crc;
}

class Writer {
public:
    explicit Writer(std::uint8_t* to) : to_(to) {}

    template <typename Unsigned>
    void whole(Unsigned value) {
        for (std::size_t i = 0; i < sizeof value; ++i) *to_++ = static_cast<std::uint8_t>(value >> (8 * i));
    }

    void real(float value) {
        static_assert(sizeof(float) == 4, "IEEE 754 binary32");
        std::uint32_t bits;
        std::memcpy(&bits, &value, sizeof bits);
        whole(bits);
    }

    void real(double value) {
        static_assert(sizeof(double) == 8, "IEEE 754 binary64");
        std::uint64_t bits;
        std::memcpy(&bits, &value, sizeof bits);
        whole(bits);
    }

    void joints(const std::array<float, 6>& values) {
        for (float value : values) real(value);
    }

private:
    std::uint8_t* to_;
};

inline std::array<std::uint8_t, kLength> encode(const Sample& sample) {
    std::array<std::uint8_t, kLength> data{};
    Writer out(data.data());
    for (char letter : {'S', 'R', 'D', 'F'}) out.whole(static_cast<std::uint8_t>(letter));
    out.whole(kVersion);
    out.whole(static_cast<std::uint16_t>(kLength));
    out.whole(sample.number);
    out.whole(sample.flags);
    out.real(sample.time);
    out.joints(sample.positions);
    out.joints(sample.speeds);
    out.joints(sample.torques);
    out.joints(sample.external);
    out.whole(sample.mode);
    out.whole(sample.state);
    out.whole(sample.control);
    out.whole(crc32(data.data(), kLength - 4));
    return data;
}

}  // namespace bridge
