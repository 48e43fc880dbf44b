// A controller's loop: plans, does one step after the other with a robot that is a stub, and plans again within a deadline
// when a part is stuck or has slipped: controller [RUNTIME_DIR].
#include <algorithm>
#include <cstdio>
#include <random>

#include <sbdp.hpp>

namespace {

using Clock = std::chrono::steady_clock;
constexpr int SIDE = 3;                                     // Cubes along each axis.
constexpr auto DEADLINE = std::chrono::milliseconds(500);   // For each plan: what is known by then is done.

// A robot that does what it is told, but now and then a part does not come off. The seed makes runs alike.
class StubRobot {
public:
    bool perform(const sbdp::StepView &) { return chance_(random_) >= 0.15; }

private:
    std::mt19937 random_{7};
    std::uniform_real_distribution<double> chance_{0.0, 1.0};
};

struct Meshed {
    std::vector<std::string> names;
    std::vector<std::vector<double>> vertices;
    std::vector<std::uint32_t> triangles{0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};

    // A block of cubes with faces that touch.
    Meshed() {
        for (int place = 0; place < SIDE * SIDE * SIDE; ++place) {
            const int at[3] = {place % SIDE, place / SIDE % SIDE, place / SIDE / SIDE};
            std::vector<double> corners;
            for (int corner = 0; corner < 8; ++corner) {
                for (int axis = 0; axis < 3; ++axis) {
                    corners.push_back(at[axis] + ((corner >> axis) & 1));
                }
            }
            vertices.push_back(corners);
            names.push_back("cube-" + std::to_string(place));
        }
    }

    sbdp::Assembly assembly() const {
        sbdp::Assembly assembly;
        assembly.units = "m";
        for (std::size_t i = 0; i < names.size(); ++i) {
            assembly.parts.emplace_back(names[i].c_str(), vertices[i], triangles);
        }
        return assembly;
    }
};

void run(const std::string &runtime_dir) {
    sbdp::ConnectOptions options;
    options.runtime_dir = runtime_dir;
    const sbdp::Client client(options);
    const Meshed meshed;
    const sbdp::Meshes meshes(meshed.assembly());
    sbdp::Session session = client.session(meshes);
    session.set_timeout(DEADLINE);

    StubRobot robot;
    std::vector<std::uint32_t> stuck;
    std::vector<double> latencies;
    std::size_t done = 0;
    for (;;) {
        const auto asked = Clock::now();
        const sbdp::Plan plan = session.replan().to_end();
        latencies.push_back(std::chrono::duration<double, std::milli>(Clock::now() - asked).count());
        std::printf("planned %zu steps in %.2f ms\n", plan.size(), latencies.back());
        bool again = false;
        for (std::size_t i = 0; i < plan.size() && !again; ++i) {
            const sbdp::StepView step = plan[i];
            if (robot.perform(step)) {
                session.performed(step);
                ++done;
                continue;
            }
            for (const std::uint32_t part : step.parts()) {
                std::printf("%s is stuck\n", meshed.names[part].c_str());
                session.stuck(part);
                stuck.push_back(part);
            }
            again = true;
        }
        if (again || plan.summary().status() == SBDP_PLAN_STATUS_TIMEOUT) {
            continue;
        }
        if (stuck.empty()) {
            std::printf("%zu steps done, %zu parts stay\n", done, plan.summary().remaining().size());
            break;
        }
        // All others are out: somebody has loosened what was stuck.
        for (const std::uint32_t part : stuck) {
            session.freed(part);
        }
        stuck.clear();
    }
    std::sort(latencies.begin(), latencies.end());
    std::printf("%zu plans: median %.2f ms, longest %.2f ms\n", latencies.size(), latencies[latencies.size() / 2],
                latencies.back());
}

} // namespace

int main(int count, char **arguments) {
    try {
        run(count > 1 ? arguments[1] : "");
    } catch (const sbdp::Error &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
}
