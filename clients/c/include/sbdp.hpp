// The client of the sbdp daemon for C++17, over sbdp.h. README.md says how to build, link and use it.
//
// Failures throw sbdp::Error, so that no error is overlooked, and constructors and loops stay simple. Code without
// exceptions uses sbdp.h, which returns codes. All classes own what they hold. They can be moved, not copied.
#ifndef SBDP_HPP
#define SBDP_HPP

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "sbdp.h"

namespace sbdp {

using Code = ::SbdpCode;
using Handle = ::SbdpHandle;
// The shift x, y, z, then the unit quaternion w, x, y, z.
using Motion = std::array<double, 7>;
using Nanoseconds = std::chrono::nanoseconds;

// Why a call failed, and what to do.
class Error : public std::runtime_error {
public:
    explicit Error(const SbdpError &error)
        : std::runtime_error(error.message), code_(static_cast<Code>(error.code)), retry_(error.retry_ms) {}

    Code code() const noexcept { return code_; }
    // For SBDP_CODE_BUSY: the time to wait before the next try.
    std::chrono::milliseconds retry_after() const noexcept { return retry_; }
    bool is_no_daemon() const noexcept { return code_ == SBDP_CODE_NO_DAEMON || code_ == SBDP_CODE_DAEMON_DIED; }

private:
    Code code_;
    std::chrono::milliseconds retry_;
};

// A view of an array of the library, which says how long it is valid.
template <class T> class Array {
public:
    Array(const T *data, std::size_t size) noexcept : data_(data), size_(size) {}
    const T *data() const noexcept { return data_; }
    std::size_t size() const noexcept { return size_; }
    bool empty() const noexcept { return size_ == 0; }
    const T *begin() const noexcept { return data_; }
    const T *end() const noexcept { return data_ + size_; }
    const T &operator[](std::size_t place) const { return data_[place]; }

private:
    const T *data_;
    std::size_t size_;
};

namespace detail {

// Calls a function whose last argument is the error.
template <class F, class... A> void call(F function, A... arguments) {
    SbdpError error;
    if (function(arguments..., &error) != SBDP_CODE_OK) {
        throw Error(error);
    }
}

template <class T, void (*Free)(T **)> struct Deleter {
    void operator()(T *value) const noexcept { Free(&value); }
};
template <class T, void (*Free)(T **)> using Owned = std::unique_ptr<T, Deleter<T, Free>>;

// The caller's function that interrupts calls. It lives as long as anything that may call it.
using Interrupt = std::shared_ptr<std::function<bool()>>;

extern "C" inline std::int32_t sbdp_hpp_is_interrupted(void *function) {
    try {
        return (*static_cast<std::function<bool()> *>(function))();
    } catch (...) {
        return 1; // Nothing may be thrown through the library.
    }
}

inline std::uint64_t count(Nanoseconds time) { return time.count() < 0 ? 0 : static_cast<std::uint64_t>(time.count()); }

// A pointer to the caller's time, valid during a call.
class Time {
public:
    explicit Time(const std::optional<Nanoseconds> &time) : given_(time), count_(time ? count(*time) : 0) {}
    const std::uint64_t *get() const { return given_ ? &count_ : nullptr; }

private:
    bool given_;
    std::uint64_t count_;
};

} // namespace detail

// How to find the daemon, and how long to wait for it.
struct ConnectOptions {
    std::string runtime_dir; // Empty for the default.
    std::optional<Nanoseconds> timeout, upload_timeout, reconnect, busy_wait, poll;
    // Called at least every 50 ms by calls that wait for the daemon. True ends the call, and so does an exception.
    std::function<bool()> interrupt;
};

// A part: a closed mesh at its assembled pose. It borrows its arrays, and its name, until the call that takes it returns.
class Part {
public:
    Part(const char *name, const double *vertices, std::size_t vertex_count, const std::uint32_t *triangles,
         std::size_t triangle_count)
        : part_{name, vertices, nullptr, vertex_count, triangles, triangle_count} {}
    Part(const char *name, const float *vertices, std::size_t vertex_count, const std::uint32_t *triangles,
         std::size_t triangle_count)
        : part_{name, nullptr, vertices, vertex_count, triangles, triangle_count} {}
    // Vertices as x, y, z each, and triangles as three vertices each, one after the other.
    template <class Number>
    Part(const char *name, const std::vector<Number> &vertices, const std::vector<std::uint32_t> &triangles)
        : Part(name, vertices.data(), vertices.size() / 3, triangles.data(), triangles.size() / 3) {
        if (vertices.size() % 3 != 0 || triangles.size() % 3 != 0) {
            throw std::invalid_argument(std::string("part ") + name + ": vertices and triangles have three numbers each");
        }
    }
    template <class Number>
    Part(const char *name, const std::vector<std::array<Number, 3>> &vertices,
         const std::vector<std::array<std::uint32_t, 3>> &triangles)
        : Part(name, vertices.empty() ? nullptr : vertices.front().data(), vertices.size(),
               triangles.empty() ? nullptr : triangles.front().data(), triangles.size()) {}

    const SbdpPart &c() const { return part_; }

private:
    SbdpPart part_;
};

// An assembly. Part numbers are indices into its list of parts.
struct Assembly {
    std::vector<Part> parts;
    std::string name, units;
    std::vector<std::string> fixed;
};

namespace detail {

template <class F> auto with_assembly(const Assembly &assembly, F use) {
    std::vector<SbdpPart> parts;
    for (const Part &part : assembly.parts) {
        parts.push_back(part.c());
    }
    std::vector<const char *> fixed;
    for (const std::string &name : assembly.fixed) {
        fixed.push_back(name.c_str());
    }
    SbdpAssembly given{};
    given.struct_size = sizeof given;
    given.name = assembly.name.c_str();
    given.units = assembly.units.empty() ? nullptr : assembly.units.c_str();
    given.parts = parts.data();
    given.part_count = parts.size();
    given.fixed = fixed.data();
    given.fixed_count = fixed.size();
    return use(&given);
}

} // namespace detail

// What to plan. Fields that are not set have their defaults.
struct PlanOptions {
    std::uint32_t planner = SBDP_PLANNER_DEFAULT, engine = SBDP_ENGINE_DEFAULT, actions = SBDP_ACTIONS_DEFAULT;
    std::uint32_t static_analysis = SBDP_STATIC_ANALYSIS_DEFAULT, staging = SBDP_STAGING_DISASSEMBLY, threads = 0;
    std::optional<bool> sweeps;
    bool no_cache = false, batch = false, trace = false;
    std::uint64_t seed = 0;
    std::optional<Nanoseconds> timeout, planning_timeout, path_timeout;
    std::optional<std::uint64_t> max_simulations;
    std::optional<double> end_gap;
    std::optional<std::array<double, 3>> up;
    std::vector<std::uint32_t> fixed, removed, base, keep, keep_out;
    std::optional<std::vector<std::uint32_t>> targets;
    std::vector<std::vector<std::uint32_t>> groups;
    std::vector<SbdpMovedPart> moved, staged;
    std::vector<SbdpPenalty> penalty;
    // The sum of some SBDP_REPORT_…: what to report about each step in the plan's JSON.
    std::uint32_t reports = 0;
    // An order in which few parts have to be held at once; of at most so many hands, if that is not 0.
    bool steady = false;
    std::uint32_t hands = 0;
    std::optional<double> friction;
    std::optional<std::array<double, 3>> against_gravity;
    // The distance that parts keep from what they pass, unless they are nearer as they stand.
    double clearance = 0;
};

namespace detail {

template <class F> auto with_options(const PlanOptions &o, F use) {
    const Time timeout(o.timeout), planning_timeout(o.planning_timeout), path_timeout(o.path_timeout);
    std::vector<SbdpGroup> groups;
    for (const auto &group : o.groups) {
        groups.push_back({group.data(), group.size()});
    }
    // No targets at all are an array, too.
    static constexpr std::uint32_t none = 0;
    SbdpPlanOptions c{};
    c.struct_size = sizeof c;
    c.planner = o.planner;
    c.engine = o.engine;
    c.actions = o.actions;
    c.static_analysis = o.static_analysis;
    c.sweeps = !o.sweeps ? SBDP_CHOICE_DEFAULT : *o.sweeps ? SBDP_CHOICE_YES : SBDP_CHOICE_NO;
    c.staging = o.staging;
    c.threads = o.threads;
    c.no_cache = o.no_cache;
    c.batch = o.batch;
    c.trace = o.trace;
    c.seed = o.seed;
    c.timeout_ns = timeout.get();
    c.planning_timeout_ns = planning_timeout.get();
    c.path_timeout_ns = path_timeout.get();
    c.max_simulations = o.max_simulations ? &*o.max_simulations : nullptr;
    c.end_gap = o.end_gap ? &*o.end_gap : nullptr;
    c.up = o.up ? o.up->data() : nullptr;
    c.fixed = o.fixed.data(), c.fixed_count = o.fixed.size();
    c.removed = o.removed.data(), c.removed_count = o.removed.size();
    if (o.targets) {
        c.targets = o.targets->empty() ? &none : o.targets->data();
        c.target_count = o.targets->size();
    }
    c.base = o.base.data(), c.base_count = o.base.size();
    c.keep = o.keep.data(), c.keep_count = o.keep.size();
    c.keep_out = o.keep_out.data(), c.keep_out_count = o.keep_out.size();
    c.groups = groups.data(), c.group_count = groups.size();
    c.moved = o.moved.data(), c.moved_count = o.moved.size();
    c.staged = o.staged.data(), c.staged_count = o.staged.size();
    c.penalty = o.penalty.data(), c.penalty_count = o.penalty.size();
    c.reports = o.reports;
    c.steady = o.steady || o.hands != 0;
    c.hands = o.hands;
    c.friction = o.friction ? &*o.friction : nullptr;
    c.against_gravity = o.against_gravity ? o.against_gravity->data() : nullptr;
    c.clearance = o.clearance;
    return use(&c);
}

} // namespace detail

// A verified step, read in place. Its source says how long it is valid.
class StepView {
public:
    explicit StepView(const SbdpStep *step) noexcept : step_(step) {}
    std::uint32_t number() const { return step_->number; }
    Array<std::uint32_t> parts() const { return {step_->parts, step_->part_count}; }
    // Motions of seven numbers each, as Motion.
    Array<double[7]> path() const { return {step_->path, step_->waypoint_count}; }
    // Numbers of the steps that must be done before.
    Array<std::uint32_t> required() const { return {step_->required, step_->required_count}; }
    SbdpStepEnd ends() const { return static_cast<SbdpStepEnd>(step_->ends); }
    std::optional<std::uint32_t> of() const { return step_->of == UINT32_MAX ? std::nullopt : std::optional(step_->of); }
    std::optional<std::array<double, 3>> direction() const {
        if (!step_->has_direction) {
            return std::nullopt;
        }
        return std::array<double, 3>{step_->direction[0], step_->direction[1], step_->direction[2]};
    }
    const SbdpStep *c() const { return step_; }

private:
    const SbdpStep *step_;
};

// A step that owns the memory in which it is read. Nothing is copied.
class Step {
public:
    explicit Step(StepView step) {
        SbdpStep *kept = nullptr;
        detail::call(sbdp_step_keep, step.c(), &kept);
        step_.reset(kept);
    }
    StepView view() const { return StepView(step_.get()); }

private:
    detail::Owned<SbdpStep, sbdp_step_free> step_;
};

// Everything about a plan except its steps, valid as long as its source.
class Summary {
public:
    explicit Summary(const SbdpSummary *summary) noexcept : summary_(summary) {}
    SbdpPlanStatus status() const { return static_cast<SbdpPlanStatus>(summary_->status); }
    Array<std::uint32_t> remaining() const { return {summary_->remaining, summary_->remaining_count}; }
    std::size_t part_count() const { return summary_->part_count; }
    std::string_view part_name(std::uint32_t part) const { return part < part_count() ? summary_->parts[part] : "?"; }
    // All fields.
    const SbdpSummary *operator->() const { return summary_; }

private:
    const SbdpSummary *summary_;
};

// A finished plan. Several threads may read it at the same time.
class Plan {
public:
    explicit Plan(SbdpPlan *plan) : plan_(plan) {}
    std::size_t size() const { return sbdp_plan_step_count(plan_.get()); }
    // A step, valid as long as the plan.
    StepView operator[](std::size_t number) const {
        const SbdpStep *step = sbdp_plan_step(plan_.get(), number);
        if (step == nullptr) {
            throw std::out_of_range("the plan has no step " + std::to_string(number));
        }
        return StepView(step);
    }
    Summary summary() const { return Summary(sbdp_plan_summary(plan_.get())); }
    std::string_view trace() const { return sbdp_plan_trace(plan_.get()); }
    // JSON as the command line writes it, without what only the files of an assembly have; as long as the plan.
    std::string_view to_json() const {
        const char *json = nullptr;
        detail::call(sbdp_plan_json, plan_.get(), &json);
        return json;
    }

private:
    detail::Owned<SbdpPlan, sbdp_plan_free> plan_;
};

// A plan as it arrives, for one thread at a time. Destroying it cancels the request. It may outlive its client.
class Stream {
public:
    Stream(SbdpStream *stream, detail::Interrupt interrupt) : interrupt_(std::move(interrupt)), stream_(stream) {}

    // Waits for the next event, valid until the next call; of kind SBDP_EVENT_KIND_END after the end.
    const SbdpEvent &next() {
        const SbdpEvent *event = nullptr;
        detail::call(sbdp_stream_next, stream_.get(), &event);
        return *event;
    }
    // The next event if it arrives within a time, which may be zero; otherwise one of kind SBDP_EVENT_KIND_PENDING.
    const SbdpEvent &poll(Nanoseconds within) {
        const SbdpEvent *event = nullptr;
        detail::call(sbdp_stream_poll, stream_.get(), detail::count(within), &event);
        return *event;
    }
    // Reads steps in shared memory from now on, without a copy, of two messages at a time.
    void read_in_place() { detail::call(sbdp_stream_read_in_place, stream_.get()); }
    // Asks the daemon to stop soon. The stream continues until its end.
    void cancel() { detail::call(sbdp_stream_cancel, stream_.get()); }
    // Waits for the end of the plan and keeps everything. The stream is used up.
    Plan to_end() {
        SbdpStream *stream = stream_.release();
        SbdpPlan *plan = nullptr;
        detail::call(sbdp_stream_to_end, &stream, &plan);
        return Plan(plan);
    }

private:
    // Declared before the stream, which may call it until its end.
    detail::Interrupt interrupt_;
    detail::Owned<SbdpStream, sbdp_stream_free> stream_;
};

// Meshes that the library keeps, and uploads whenever the daemon does not know them, for example after a restart.
class Meshes {
public:
    explicit Meshes(const Assembly &assembly) {
        SbdpMeshes *meshes = nullptr;
        detail::with_assembly(assembly, [&](auto *given) { detail::call(sbdp_meshes_copy, given, &meshes); });
        meshes_.reset(meshes);
    }
    Handle handle() const {
        Handle handle{};
        detail::call(sbdp_meshes_handle, meshes_.get(), &handle);
        return handle;
    }
    const SbdpMeshes *c() const { return meshes_.get(); }

private:
    detail::Owned<SbdpMeshes, sbdp_meshes_free> meshes_;
};

// An assembly that is being taken apart: what has happened to it, and plans for the rest. For one thread at a time.
class Session {
public:
    Session(SbdpSession *session, detail::Interrupt interrupt) : interrupt_(std::move(interrupt)), session_(session) {}

    std::uint32_t part(const std::string &name) const {
        std::uint32_t part = 0;
        detail::call(sbdp_session_part, session_.get(), name.c_str(), &part);
        return part;
    }
    void executed(const std::vector<std::uint32_t> &parts) {
        detail::call(sbdp_session_executed, session_.get(), parts.data(), parts.size());
    }
    // Records that a step of the last plan was done.
    void performed(StepView step) { detail::call(sbdp_session_performed, session_.get(), step.c()); }
    void stuck(std::uint32_t part) { detail::call(sbdp_session_stuck, session_.get(), part); }
    void freed(std::uint32_t part) { detail::call(sbdp_session_freed, session_.get(), part); }
    void moved(std::uint32_t part, const Motion &motion) {
        SbdpMovedPart moved{};
        moved.part = part;
        for (std::size_t i = 0; i < motion.size(); ++i) {
            moved.motion[i] = motion[i];
        }
        const SbdpMovedPart *given = &moved;
        detail::call(sbdp_session_moved, session_.get(), given);
    }
    // The timeout of later plans; none for no limit.
    void set_timeout(std::optional<Nanoseconds> timeout) {
        const detail::Time time(timeout);
        detail::call(sbdp_session_set_timeout, session_.get(), time.get());
    }
    Stream replan() {
        SbdpStream *stream = nullptr;
        detail::call(sbdp_session_replan, session_.get(), &stream);
        return Stream(stream, interrupt_);
    }

private:
    detail::Interrupt interrupt_;
    detail::Owned<SbdpSession, sbdp_session_free> session_;
};

// A client of one daemon. Threads may share it. It receives one plan at a time: connect several clients for more.
class Client {
public:
    explicit Client(const ConnectOptions &options = {}) {
        const detail::Time timeout(options.timeout), upload(options.upload_timeout), reconnect(options.reconnect);
        const detail::Time busy(options.busy_wait), poll(options.poll);
        SbdpConnectOptions given{};
        given.struct_size = sizeof given;
        given.runtime_dir = options.runtime_dir.empty() ? nullptr : options.runtime_dir.c_str();
        given.timeout_ns = timeout.get();
        given.upload_timeout_ns = upload.get();
        given.reconnect_ns = reconnect.get();
        given.busy_wait_ns = busy.get();
        given.poll_ns = poll.get();
        if (options.interrupt) {
            interrupt_ = std::make_shared<std::function<bool()>>(options.interrupt);
            given.interrupt = detail::sbdp_hpp_is_interrupted;
            given.interrupt_data = interrupt_.get();
        }
        SbdpClient *client = nullptr;
        const SbdpConnectOptions *pointer = &given;
        detail::call(sbdp_client_connect, pointer, &client);
        client_.reset(client);
    }

    // Uploads an assembly. One that the daemon knows is not copied again.
    Handle upload(const Assembly &assembly) const {
        Handle handle{};
        detail::with_assembly(assembly, [&](auto *c) { detail::call(sbdp_client_upload, client_.get(), c, &handle); });
        return handle;
    }
    bool knows(const Handle &handle) const {
        bool known = false;
        detail::call(sbdp_client_knows, client_.get(), &handle, &known);
        return known;
    }
    Handle revise(const Handle &base, const SbdpChange &change) const {
        Handle revised{};
        detail::call(sbdp_client_revise, client_.get(), &base, &change, &revised);
        return revised;
    }
    Stream plan(const Handle &handle, const PlanOptions &options = {}) const {
        return begin<Stream, SbdpStream>(sbdp_client_plan, &handle, options);
    }
    Stream plan(const Meshes &meshes, const PlanOptions &options = {}) const {
        return begin<Stream, SbdpStream>(sbdp_client_plan_meshes, meshes.c(), options);
    }
    Session session(const Handle &handle, const PlanOptions &options = {}) const {
        return begin<Session, SbdpSession>(sbdp_client_session, &handle, options);
    }
    Session session(const Meshes &meshes, const PlanOptions &options = {}) const {
        return begin<Session, SbdpSession>(sbdp_client_session_meshes, meshes.c(), options);
    }
    // All metrics of the daemon: a JSON object.
    std::string metrics() const {
        char *text = nullptr;
        detail::call(sbdp_client_metrics, client_.get(), &text);
        const detail::Owned<char, sbdp_text_free> owned(text);
        return text;
    }
    std::uint32_t daemon_pid() const { return sbdp_client_daemon_pid(client_.get()); }
    std::uint32_t restarts() const { return sbdp_client_restarts(client_.get()); }

private:
    template <class Made, class C, class F, class Subject>
    Made begin(F function, const Subject *subject, const PlanOptions &options) const {
        C *made = nullptr;
        detail::with_options(
            options, [&](const SbdpPlanOptions *c) { detail::call(function, client_.get(), subject, c, &made); });
        return Made(made, interrupt_);
    }

    detail::Interrupt interrupt_;
    detail::Owned<SbdpClient, sbdp_client_free> client_;
};

} // namespace sbdp

#endif
