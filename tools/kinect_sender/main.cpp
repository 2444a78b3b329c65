// Sends what Azure Kinect body tracking finds to seerob: one JSON object per picture, in UDP datagrams.
//
//   kinect_sender 192.168.0.20 [port = 9871] [frames per second = 30]
//
// Runs where the camera is plugged in (Windows or Linux, with the GPU that the tracker needs). Works with an
// Azure Kinect and, through Orbbec's K4A wrapper, with a Femto Bolt or Mega. Ctrl-C ends it.
// The message is explained in docs/sources/kinect.md of seerob.

#include <k4a/k4a.h>
#include <k4abt.h>

#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>

#ifdef _WIN32
#include <winsock2.h>
#include <ws2tcpip.h>
using Socket = SOCKET;
static const Socket NO_SOCKET = INVALID_SOCKET;
static void close_socket(Socket s) { closesocket(s); }
#else
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>
using Socket = int;
static const Socket NO_SOCKET = -1;
static void close_socket(Socket s) { close(s); }
#endif

static std::atomic<bool> over{false};
static void stop(int) { over = true; }

static Socket connect_to(const char* host, const char* port) {
    addrinfo hints{}, *found = nullptr;
    hints.ai_socktype = SOCK_DGRAM;
    if (getaddrinfo(host, port, &hints, &found) != 0) return NO_SOCKET;
    Socket link = NO_SOCKET;
    for (addrinfo* a = found; a != nullptr && link == NO_SOCKET; a = a->ai_next) {
        link = socket(a->ai_family, a->ai_socktype, a->ai_protocol);
        if (link != NO_SOCKET && connect(link, a->ai_addr, static_cast<int>(a->ai_addrlen)) != 0) {
            close_socket(link);
            link = NO_SOCKET;
        }
    }
    freeaddrinfo(found);
    return link;
}

// JSON has no NaN.
static void number(std::string& out, const char* format, float value) {
    char text[32];
    if (std::isfinite(value)) {
        std::snprintf(text, sizeof text, format, static_cast<double>(value));
        out += text;
    } else {
        out += "null";
    }
}

static void numbers(std::string& out, const char* format, const float* values, int count) {
    out += '[';
    for (int i = 0; i < count; ++i) {
        if (i > 0) out += ',';
        number(out, format, values[i]);
    }
    out += ']';
}

static void body(std::string& out, uint32_t id, const k4abt_skeleton_t& skeleton) {
    out += "{\"body_id\":" + std::to_string(id) + ",\"joint_positions\":[";
    for (int j = 0; j < K4ABT_JOINT_COUNT; ++j) {
        if (j > 0) out += ',';
        numbers(out, "%.1f", skeleton.joints[j].position.v, 3);  // mm
    }
    out += "],\"joint_orientations\":[";
    for (int j = 0; j < K4ABT_JOINT_COUNT; ++j) {
        if (j > 0) out += ',';
        numbers(out, "%.5f", skeleton.joints[j].orientation.v, 4);  // w, x, y, z
    }
    out += "],\"joint_confidences\":[";
    for (int j = 0; j < K4ABT_JOINT_COUNT; ++j) {
        if (j > 0) out += ',';
        out += std::to_string(static_cast<int>(skeleton.joints[j].confidence_level));
    }
    out += "]}";
}

// What the accelerometer feels, slowly averaged, in the frame of the depth camera [m/s^2].
struct Gravity {
    float value[3] = {0, 0, 0};
    bool known = false;

    void hear(k4a_device_t device, const k4a_calibration_t& calibration) {
        k4a_imu_sample_t sample;
        while (k4a_device_get_imu_sample(device, &sample, 0) == K4A_WAIT_RESULT_SUCCEEDED) {
            const float* r = calibration.extrinsics[K4A_CALIBRATION_TYPE_ACCEL][K4A_CALIBRATION_TYPE_DEPTH].rotation;
            const float* a = sample.acc_sample.v;
            for (int i = 0; i < 3; ++i) {
                const float turned = r[3 * i] * a[0] + r[3 * i + 1] * a[1] + r[3 * i + 2] * a[2];
                value[i] += (known ? 0.002f : 1.0f) * (turned - value[i]);
            }
            known = true;
        }
    }
};

static k4a_fps_t fps_of(int fps) {
    return fps >= 30 ? K4A_FRAMES_PER_SECOND_30 : fps >= 15 ? K4A_FRAMES_PER_SECOND_15 : K4A_FRAMES_PER_SECOND_5;
}

#define CHECK(call, what)                          \
    if ((call) != K4A_RESULT_SUCCEEDED) {          \
        std::fprintf(stderr, "%s failed\n", what); \
        return 1;                                  \
    }

int main(int argc, char** argv) {
    if (argc < 2) {
        std::fprintf(stderr, "usage: %s host-of-seerob [port = 9871] [frames per second: 5, 15, 30]\n", argv[0]);
        return 2;
    }
    const char* port = argc > 2 ? argv[2] : "9871";
    std::signal(SIGINT, stop);
    std::signal(SIGTERM, stop);
#ifdef _WIN32
    WSADATA data;
    WSAStartup(MAKEWORD(2, 2), &data);
#endif
    const Socket link = connect_to(argv[1], port);
    if (link == NO_SOCKET) {
        std::fprintf(stderr, "no such address: %s %s\n", argv[1], port);
        return 1;
    }

    k4a_device_t device = nullptr;
    CHECK(k4a_device_open(K4A_DEVICE_DEFAULT, &device), "opening the camera (is it plugged in?)");
    char serial[64] = "";
    size_t size = sizeof serial;
    k4a_device_get_serialnum(device, serial, &size);

    k4a_device_configuration_t config = K4A_DEVICE_CONFIG_INIT_DISABLE_ALL;
    config.depth_mode = K4A_DEPTH_MODE_NFOV_UNBINNED;
    config.camera_fps = fps_of(argc > 3 ? std::atoi(argv[3]) : 30);
    CHECK(k4a_device_start_cameras(device, &config), "starting the camera");
    const bool imu = k4a_device_start_imu(device) == K4A_RESULT_SUCCEEDED;
    k4a_calibration_t calibration;
    CHECK(k4a_device_get_calibration(device, config.depth_mode, config.color_resolution, &calibration),
          "reading the calibration");
    k4abt_tracker_t tracker = nullptr;
    CHECK(k4abt_tracker_create(&calibration, K4ABT_TRACKER_CONFIG_DEFAULT, &tracker),
          "starting body tracking (is its model there, is the GPU's driver new enough?)");
    std::printf("camera %s: sending to %s:%s\n", serial, argv[1], port);

    Gravity gravity;
    uint64_t frame_id = 0;
    while (!over) {
        k4a_capture_t capture = nullptr;
        const k4a_wait_result_t taken = k4a_device_get_capture(device, &capture, 1000);
        if (taken == K4A_WAIT_RESULT_FAILED) {
            std::fprintf(stderr, "the camera was lost\n");
            break;
        }
        if (taken != K4A_WAIT_RESULT_SUCCEEDED) continue;
        const k4a_wait_result_t queued = k4abt_tracker_enqueue_capture(tracker, capture, K4A_WAIT_INFINITE);
        k4a_capture_release(capture);
        if (queued == K4A_WAIT_RESULT_FAILED) break;
        if (imu) gravity.hear(device, calibration);

        k4abt_frame_t frame = nullptr;
        if (k4abt_tracker_pop_result(tracker, &frame, K4A_WAIT_INFINITE) != K4A_WAIT_RESULT_SUCCEEDED) continue;
        const uint32_t count = k4abt_frame_get_num_bodies(frame);
        std::string text = "{\"seerob\":\"kinect/1\",\"camera\":\"" + std::string(serial) + "\",\"timestamp_usec\":" +
                           std::to_string(k4abt_frame_get_device_timestamp_usec(frame)) +
                           ",\"frame_id\":" + std::to_string(frame_id++) +
                           ",\"num_bodies\":" + std::to_string(count);
        if (gravity.known) {
            text += ",\"gravity\":";
            numbers(text, "%.3f", gravity.value, 3);
        }
        // A picture in which nobody is seen is sent too: seerob must know that nobody is.
        text += ",\"bodies\":[";
        for (uint32_t i = 0; i < count; ++i) {
            k4abt_skeleton_t skeleton;
            if (k4abt_frame_get_body_skeleton(frame, i, &skeleton) != K4A_RESULT_SUCCEEDED) std::memset(&skeleton, 0, sizeof skeleton);
            if (i > 0) text += ',';
            body(text, k4abt_frame_get_body_id(frame, i), skeleton);
        }
        text += "]}";
        k4abt_frame_release(frame);
        // Nobody may be listening yet; that is no reason to stop.
        send(link, text.data(), static_cast<int>(text.size()), 0);
    }

    k4abt_tracker_shutdown(tracker);
    k4abt_tracker_destroy(tracker);
    if (imu) k4a_device_stop_imu(device);
    k4a_device_stop_cameras(device);
    k4a_device_close(device);
    close_socket(link);
    return 0;
}
