// The C++ wrapper against a daemon of its own: client_cpp SBDPD PLACE ROUNDS.
#include <atomic>
#include <thread>
#include <type_traits>

#include "sbdp.hpp"
#include "support.h"

template <class T> constexpr bool moves_only = std::is_nothrow_move_constructible_v<T> && !std::is_copy_constructible_v<T>;
static_assert(moves_only<sbdp::Client> && moves_only<sbdp::Stream> && moves_only<sbdp::Plan> && moves_only<sbdp::Session>);
static_assert(moves_only<sbdp::Meshes> && moves_only<sbdp::Step>);

template <class F> sbdp::Code thrown(F run) {
    try {
        run();
    } catch (const sbdp::Error &error) {
        CHECK(error.what()[0] != 0);
        return error.code();
    }
    return SBDP_CODE_OK;
}

int main(int count, char **arguments) {
    CHECK(count == 4);
    const std::string place = arguments[2];
    std::atomic<bool> wanted{false};
    sbdp::ConnectOptions options;
    options.runtime_dir = place + "/run";
    options.reconnect = std::chrono::seconds(0);
    options.interrupt = [&] { return wanted.load(); };
    CHECK(thrown([&] { sbdp::Client none(options); }) == SBDP_CODE_NO_DAEMON);
    pid_t daemon = start_daemon(arguments[1], place.c_str());

    std::vector<double> low(24), high(24);
    cuboid(low.data(), 0, 1, 0), cuboid(high.data(), 0, 1, 1);
    const std::vector<float> narrow(high.begin(), high.end());
    const std::vector<std::uint32_t> triangles(CUBE, CUBE + 36);
    sbdp::Assembly assembly;
    assembly.units = "mm";
    assembly.parts = {{"low", low, triangles}, {"high", narrow, triangles}};

    sbdp::Client first(options);
    sbdp::Client client = std::move(first);
    CHECK(thrown([&] { first.metrics(); }) == SBDP_CODE_ARGUMENT);
    const sbdp::Handle handle = client.upload(assembly);
    CHECK(client.knows(handle) && client.metrics().front() == '{');

    const sbdp::Plan plan = client.plan(handle).to_end();
    CHECK(plan.size() == 1 && plan.summary().status() == SBDP_PLAN_STATUS_COMPLETE);
    CHECK(plan[0].parts().size() == 1 && plan[0].path()[0][3] == 1.0 && plan[0].ends() == SBDP_STEP_END_OUT);
    CHECK(plan.summary().part_name(plan[0].parts()[0]) == "low" || plan.summary().part_name(plan[0].parts()[0]) == "high");

    // All options arrive: the cube that may not move stays, and the other one leaves upwards.
    sbdp::PlanOptions chosen;
    chosen.fixed = {0};
    chosen.up = {0.0, 0.0, 1.0};
    chosen.end_gap = 0.5;
    chosen.clearance = 0.25;
    chosen.timeout = std::chrono::seconds(60);
    chosen.targets = std::vector<std::uint32_t>{1};
    const sbdp::Plan upwards = client.plan(handle, chosen).to_end();
    CHECK(upwards.size() == 1 && upwards[0].parts()[0] == 1 && upwards[0].direction().has_value());
    CHECK((*upwards[0].direction())[2] > 0.9);
    chosen.targets->clear();
    CHECK(client.plan(handle, chosen).to_end().size() == 0);
    sbdp::PlanOptions keeping;
    keeping.keep = {0, 1};
    const sbdp::Plan kept_both = client.plan(handle, keeping).to_end();
    CHECK(kept_both.size() == 0 && kept_both.summary().status() == SBDP_PLAN_STATUS_COMPLETE);
    CHECK(kept_both.summary()->keep_count == 2);

    // Steps that are kept outlive their stream; events by polling.
    std::vector<sbdp::Step> kept;
    {
        sbdp::PlanOptions anew;
        anew.no_cache = true;
        sbdp::Stream stream = client.plan(handle, anew);
        stream.read_in_place();
        for (;;) {
            const SbdpEvent &event = stream.poll(std::chrono::milliseconds(1));
            if (event.kind == SBDP_EVENT_KIND_STEP) {
                kept.emplace_back(sbdp::StepView(event.step));
            } else if (event.kind == SBDP_EVENT_KIND_END) {
                break;
            }
        }
    }
    CHECK(kept.size() == 1 && kept[0].view().path()[0][3] == 1.0);
    kept.clear();

    // A session: a part that is stuck stays, the other is out, and nothing is left to do.
    const sbdp::Meshes meshes(assembly);
    sbdp::Session session = client.session(meshes);
    const std::uint32_t stuck = session.part("high");
    CHECK(thrown([&] { session.part("middle"); }) == SBDP_CODE_NO_SUCH_PART);
    session.stuck(stuck);
    session.set_timeout(std::chrono::seconds(60));
    const sbdp::Plan rest = session.replan().to_end();
    CHECK(rest.size() == 1 && rest[0].parts()[0] == session.part("low"));
    session.performed(rest[0]);
    CHECK(session.replan().to_end().size() == 0);
    session.moved(stuck, {0, 0, 5, 1, 0, 0, 0});
    CHECK(session.replan().to_end().summary()->pose_count == 1);

    // Threads share a plan, and each has a client.
    std::vector<std::thread> threads;
    for (int i = 0; i < 2; ++i) {
        threads.emplace_back([&] { CHECK(sbdp::Client(options).plan(handle).to_end().size() == plan.size()); });
    }
    for (std::thread &thread : threads) {
        thread.join();
    }

    const long rounds = std::atol(arguments[3]);
    long before = 0;
    for (long round = 0; round < rounds; ++round) {
        if (round == rounds / 10) {
            before = resident_kib();
        }
        CHECK(client.plan(handle).to_end().size() == 1);
    }
    const long after = resident_kib();
    std::printf("%ld plans: resident %ld KiB after a tenth, %ld KiB at the end\n", rounds, before, after);
    CHECK(after - before < 1024);

    // Meshes come again by themselves when the daemon has been replaced.
    end_daemon(daemon, SIGKILL);
    const sbdp::Code code = thrown([&] { client.plan(handle).to_end(); });
    CHECK(code == SBDP_CODE_NO_DAEMON || code == SBDP_CODE_DAEMON_DIED);
    daemon = start_daemon(arguments[1], place.c_str());
    CHECK(client.plan(meshes).to_end().size() == 1 && client.restarts() == 1);
    CHECK(kill(daemon, SIGSTOP) == 0);
    wanted = true;
    CHECK(thrown([&] { client.knows(handle); }) == SBDP_CODE_INTERRUPTED);
    CHECK(kill(daemon, SIGCONT) == 0);
    end_daemon(daemon, SIGTERM);
    std::puts("C++: all as it should be");
}
