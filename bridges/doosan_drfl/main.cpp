// Sends what Doosan's library DRFL says of a robot's joints to seerob, and commands nothing:
// no access right is asked for, no servo is switched, nothing is written to the controller.
// SPDX-License-Identifier: Apache-2.0

#include "contract.hpp"

// The maker's own header; it is not part of this program's sources.
#include "DRFLEx.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

namespace {

volatile std::sig_atomic_t over = 0;

void stop(int) { over = 1; }

struct Options {
    std::string robot;
    std::string to = "127.0.0.1";
    int port = 20128;
    int rate = 100;
    long samples = 0;  // 0: until it is stopped
};

int usage() {
    std::fprintf(stderr,
                 "usage: doosan_drfl_bridge ROBOT_IP [--to ADDRESS] [--port PORT] [--rate HZ] [--samples N]\n");
    return 2;
}

bool number(const char* text, long low, long high, long& found) {
    char* end = nullptr;
    found = std::strtol(text, &end, 10);
    return end != text && *end == '\0' && found >= low && found <= high;
}

bool parse(int count, char** words, Options& options) {
    if (count < 2 || count % 2 != 0 || words[1][0] == '-') return false;
    options.robot = words[1];
    for (int i = 2; i < count; i += 2) {
        const std::string key = words[i];
        long value = 0;
        if (key == "--to") {
            options.to = words[i + 1];
        } else if (key == "--port" && number(words[i + 1], 1, 65535, value)) {
            options.port = static_cast<int>(value);
        } else if (key == "--rate" && number(words[i + 1], 10, 1000, value)) {
            options.rate = static_cast<int>(value);
        } else if (key == "--samples" && number(words[i + 1], 1, 1000000000, value)) {
            options.samples = value;
        } else {
            return false;
        }
    }
    return true;
}

bridge::Sample sample_of(const RT_OUTPUT_DATA_LIST& data, std::uint32_t number) {
    bridge::Sample sample;
    sample.number = number;
    sample.flags = bridge::kTorques;
    sample.time = data.time_stamp;
    for (std::size_t k = 0; k < 6; ++k) {
        sample.positions[k] = data.actual_joint_position[k];
        sample.speeds[k] = data.actual_joint_velocity[k];
        sample.torques[k] = data.actual_joint_torque[k];
        sample.external[k] = data.external_joint_torque[k];
    }
    sample.mode = static_cast<std::uint8_t>(data.robot_mode);
    sample.state = static_cast<std::uint8_t>(data.robot_state);
    sample.control = static_cast<std::uint16_t>(data.control_mode);
    return sample;
}

// False when the controller has fallen silent.
bool relay(DRAFramework::CDRFLEx& robot, const Options& options, int link, const sockaddr_in& to) {
    using Clock = std::chrono::steady_clock;
    const auto period = std::chrono::microseconds(1000000 / options.rate);
    const auto patience = std::chrono::seconds(2);
    auto due = Clock::now();
    auto heard = due;
    double last = -1.0;
    std::uint32_t sent = 0;
    while (!over && (options.samples == 0 || sent < static_cast<std::uint32_t>(options.samples))) {
        const LPRT_OUTPUT_DATA_LIST data = robot.read_data_rt();
        const auto now = Clock::now();
        // The library hands out the same sample again when the controller is silent: it is not sent twice,
        // so that silence is silence on our side, too.
        if (data != nullptr && data->time_stamp != last) {
            last = data->time_stamp;
            heard = now;
            const auto message = bridge::encode(sample_of(*data, sent++));
            // Nobody may be listening yet, which is no reason to stop.
            (void)sendto(link, message.data(), message.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                         sizeof to);
        } else if (now - heard > patience) {
            return false;
        }
        due += period;
        if (due < now) due = now;
        std::this_thread::sleep_until(due);
    }
    return true;
}

}  // namespace

int main(int count, char** words) {
    Options options;
    if (!parse(count, words, options)) return usage();
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(options.port));
    if (inet_pton(AF_INET, options.to.c_str(), &to.sin_addr) != 1) {
        std::fprintf(stderr, "%s is no IPv4 address\n", options.to.c_str());
        return 2;
    }
    std::signal(SIGINT, stop);
    std::signal(SIGTERM, stop);

    const int link = socket(AF_INET, SOCK_DGRAM, 0);
    if (link < 0) {
        std::perror("socket");
        return 1;
    }
    DRAFramework::CDRFLEx robot;
    int status = 1;
    if (!robot.open_connection(options.robot, 12345)) {
        std::fprintf(stderr, "no connection to %s, port 12345\n", options.robot.c_str());
    } else {
        if (!robot.connect_rt_control(options.robot, 12347)) {
            std::fprintf(stderr, "no real-time channel at %s, port 12347\n", options.robot.c_str());
        } else {
            if (!robot.set_rt_control_output("v1.0", 1.0f / static_cast<float>(options.rate), 4) ||
                !robot.start_rt_control()) {
                std::fprintf(stderr, "the controller does not send at %d Hz\n", options.rate);
            } else {
                status = relay(robot, options, link, to) ? 0 : 1;
                if (status != 0) std::fprintf(stderr, "the controller has fallen silent\n");
                robot.stop_rt_control();
            }
            robot.disconnect_rt_control();
        }
        robot.close_connection();
    }
    close(link);
    return status;
}
