// How long a plan takes that the daemon remembers, in C and in C++: repeat c|cpp RUNTIME_DIR ROUNDS prints the handle and the
// median in microseconds. The Rust client's example `repeat` does the same.
#include <algorithm>

#include "sbdp.hpp"
#include "support.h"

int main(int count, char **arguments) {
    CHECK(count == 4);
    sbdp::ConnectOptions options;
    options.runtime_dir = arguments[2];
    std::optional<sbdp::Client> client(std::in_place, options);
    std::vector<double> low(24), high(24);
    cuboid(low.data(), 0, 1, 0), cuboid(high.data(), 0, 1, 1);
    const std::vector<std::uint32_t> triangles(CUBE, CUBE + 36);
    const sbdp::Handle handle = client->upload({{{"low", low, triangles}, {"high", high, triangles}}, "", "mm", {}});
    client->plan(handle).to_end();

    // One client at a time, as in Rust: the daemon looks at the requests of each.
    SbdpClient *plain = nullptr;
    SbdpConnectOptions given{};
    given.struct_size = sizeof given;
    given.runtime_dir = arguments[2];
    const bool in_c = arguments[1][1] == 0;
    if (in_c) {
        client.reset();
        CHECK(sbdp_client_connect(&given, &plain, nullptr) == SBDP_CODE_OK);
    }
    std::vector<double> times;
    for (long round = std::atol(arguments[3]); round > 0; --round) {
        const double start = now_us();
        if (in_c) {
            SbdpStream *stream = nullptr;
            SbdpPlan *plan = nullptr;
            SbdpError error;
            CHECK(sbdp_client_plan(plain, &handle, nullptr, &stream, &error) == SBDP_CODE_OK);
            CHECK(sbdp_stream_to_end(&stream, &plan, &error) == SBDP_CODE_OK);
            times.push_back(now_us() - start);
            CHECK(sbdp_plan_summary(plan)->stats.plan_hit == 1);
            sbdp_plan_free(&plan);
        } else {
            const sbdp::Plan plan = client->plan(handle).to_end();
            times.push_back(now_us() - start);
            CHECK(plan.summary()->stats.plan_hit == 1);
        }
    }
    sbdp_client_free(&plain);
    std::sort(times.begin(), times.end());
    for (const std::uint8_t byte : handle.bytes) {
        std::printf("%02x", byte);
    }
    std::printf(" %.2f\n", times[times.size() / 2]);
}
