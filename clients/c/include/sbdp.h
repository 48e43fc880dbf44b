/* The client of the sbdp daemon for C. README.md says how to build, link and use it.
 *
 * Lengths are in the input's units, in the input's frame. A motion is seven doubles: the shift x, y, z, then the unit
 * quaternion w, x, y, z. Part numbers are indices into the uploaded list of parts. Times are nanoseconds.
 *
 * Functions that can fail return SBDP_CODE_OK or an error code, and write the code with a message to `error`, which may be
 * null. On failure their results are null. Free functions set the pointer to null; freeing null is allowed.
 *
 * Made by cbindgen from clients/c/src: do not edit. */

#ifndef SBDP_H
#define SBDP_H

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/**
 * The result of a call. A number keeps its meaning for ever. Codes below 100 are the daemon's.
 */
enum SbdpCode
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Success.
     */
    SBDP_CODE_OK = 0,
    /**
     * The daemon cannot read the request.
     */
    SBDP_CODE_MALFORMED = 1,
    /**
     * The daemon has no assembly of this handle: upload it (again).
     */
    SBDP_CODE_UNKNOWN_HANDLE = 2,
    /**
     * The daemon's queue is full: try again after `retry_ms`.
     */
    SBDP_CODE_BUSY = 3,
    /**
     * The deadline passed before planning began.
     */
    SBDP_CODE_EXPIRED = 4,
    /**
     * The geometry was refused; the message names part and reason.
     */
    SBDP_CODE_GEOMETRY = 5,
    /**
     * There is no such part.
     */
    SBDP_CODE_NO_SUCH_PART = 6,
    /**
     * The request needs something that this daemon does not offer.
     */
    SBDP_CODE_UNSUPPORTED = 7,
    /**
     * The daemon failed; its log says more.
     */
    SBDP_CODE_FAILED = 8,
    /**
     * The client did not read the plan, and the daemon ended it.
     */
    SBDP_CODE_SLOW_READER = 9,
    /**
     * The daemon is shutting down.
     */
    SBDP_CODE_SHUTTING_DOWN = 10,
    /**
     * The message exceeds a limit of the daemon, or the memory that is left.
     */
    SBDP_CODE_TOO_LARGE = 11,
    /**
     * The request was cancelled before planning began.
     */
    SBDP_CODE_CANCELLED = 12,
    /**
     * No daemon is running at this place.
     */
    SBDP_CODE_NO_DAEMON = 100,
    /**
     * The daemon went away before it answered.
     */
    SBDP_CODE_DAEMON_DIED = 101,
    /**
     * The daemon speaks another version, or its folder or files cannot be used.
     */
    SBDP_CODE_UNUSABLE = 102,
    /**
     * The daemon has as many clients as it can serve.
     */
    SBDP_CODE_TOO_MANY_CLIENTS = 103,
    /**
     * Shared memory could not be set up.
     */
    SBDP_CODE_SETUP = 104,
    /**
     * No answer in time to a request that needs no planning.
     */
    SBDP_CODE_TIMEOUT = 105,
    /**
     * This client is already receiving a plan.
     */
    SBDP_CODE_STREAM_OPEN = 106,
    /**
     * Steps of two messages are kept in place: free them, then continue.
     */
    SBDP_CODE_VIEWS_HELD = 107,
    /**
     * The interrupt function ended the call.
     */
    SBDP_CODE_INTERRUPTED = 108,
    /**
     * The client belongs to the process that this one was forked from.
     */
    SBDP_CODE_FORKED = 109,
    /**
     * An argument cannot be used; the message names it.
     */
    SBDP_CODE_ARGUMENT = 110,
    /**
     * `/dev/shm` has too little space.
     */
    SBDP_CODE_SHARED_MEMORY = 111,
    /**
     * The request names too many parts for one message.
     */
    SBDP_CODE_REQUEST_TOO_LONG = 112,
    /**
     * The daemon's answer is wrong or cannot be read.
     */
    SBDP_CODE_PROTOCOL = 113,
    /**
     * A fault of this library: free the handles of this call, and report it.
     */
    SBDP_CODE_INTERNAL = 114,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpCode SbdpCode;
#else
typedef uint32_t SbdpCode;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The search.
 */
enum SbdpPlanner
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * `SBDP_PLANNER_SBDP_STAR`.
     */
    SBDP_PLANNER_DEFAULT = 0,
    /**
     * State-based planning guided by directional blocking graphs.
     */
    SBDP_PLANNER_SBDP_STAR = 1,
    /**
     * State-based planning without blocking graphs.
     */
    SBDP_PLANNER_SBDP = 2,
    /**
     * Breadth-first search per part, translations.
     */
    SBDP_PLANNER_PDP_T = 3,
    /**
     * Breadth-first search per part, translations and rotations.
     */
    SBDP_PLANNER_PDP_R = 4,
    /**
     * `SBDP_PLANNER_PDP_T`, then `SBDP_PLANNER_PDP_R` if that failed.
     */
    SBDP_PLANNER_PDP_STAR = 5,
    /**
     * A rapidly-exploring random tree per part, of straight paths.
     */
    SBDP_PLANNER_RRT = 6,
    /**
     * A rapidly-exploring random tree per part, of simulated motions.
     */
    SBDP_PLANNER_BK_RRT = 7,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpPlanner SbdpPlanner;
#else
typedef uint32_t SbdpPlanner;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The simulation that moves the parts.
 */
enum SbdpEngine
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * `SBDP_ENGINE_SLIDING`.
     */
    SBDP_ENGINE_DEFAULT = 0,
    /**
     * Contact-constrained sliding without inertia.
     */
    SBDP_ENGINE_SLIDING = 1,
    /**
     * The paper's penalty-based simulation.
     */
    SBDP_ENGINE_PENALTY = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpEngine SbdpEngine;
#else
typedef uint32_t SbdpEngine;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The actions that the search may use.
 */
enum SbdpActions
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * `SBDP_ACTIONS_EXTENDED`.
     */
    SBDP_ACTIONS_DEFAULT = 0,
    /**
     * The paper's.
     */
    SBDP_ACTIONS_PAPER = 1,
    /**
     * The paper's and pulling while turning.
     */
    SBDP_ACTIONS_EXTENDED = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpActions SbdpActions;
#else
typedef uint32_t SbdpActions;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How blocking graphs begin, before anything is simulated.
 */
enum SbdpStaticAnalysis
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * `SBDP_STATIC_ANALYSIS_SLIDING`.
     */
    SBDP_STATIC_ANALYSIS_DEFAULT = 0,
    /**
     * An arc where contact with the other part alone hardly lets a part move.
     */
    SBDP_STATIC_ANALYSIS_SLIDING = 1,
    /**
     * The paper's rule, taken literally.
     */
    SBDP_STATIC_ANALYSIS_PAPER = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpStaticAnalysis SbdpStaticAnalysis;
#else
typedef uint32_t SbdpStaticAnalysis;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Yes, no, or the daemon's choice.
 */
enum SbdpChoice
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The daemon chooses.
     */
    SBDP_CHOICE_DEFAULT = 0,
    /**
     * No.
     */
    SBDP_CHOICE_NO = 1,
    /**
     * Yes.
     */
    SBDP_CHOICE_YES = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpChoice SbdpChoice;
#else
typedef uint32_t SbdpChoice;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Disassembly or assembly plan, and where its parts begin.
 */
enum SbdpStaging
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * A disassembly plan.
     */
    SBDP_STAGING_DISASSEMBLY = 0,
    /**
     * An assembly plan. A part is absent before its turn, and begins where its insertion begins.
     */
    SBDP_STAGING_NONE = 1,
    /**
     * An assembly plan. Parts begin laid out beside the assembly, except for those in `staged`.
     */
    SBDP_STAGING_BESIDE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpStaging SbdpStaging;
#else
typedef uint32_t SbdpStaging;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The kind of an event.
 */
enum SbdpEventKind
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * The plan has ended, and nothing follows.
     */
    SBDP_EVENT_KIND_END = 0,
    /**
     * Nothing arrived in time; the stream continues.
     */
    SBDP_EVENT_KIND_PENDING = 1,
    /**
     * Planning made progress: see `progress`.
     */
    SBDP_EVENT_KIND_PROGRESS = 2,
    /**
     * A step, in order: see `step`.
     */
    SBDP_EVENT_KIND_STEP = 3,
    /**
     * Events of the search: see `trace`.
     */
    SBDP_EVENT_KIND_TRACE = 4,
    /**
     * The request was sent to another daemon: the steps and the trace so far are void, and come again from the first.
     */
    SBDP_EVENT_KIND_RESTARTED = 5,
    /**
     * The end of the plan: see `summary`.
     */
    SBDP_EVENT_KIND_DONE = 6,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpEventKind SbdpEventKind;
#else
typedef uint32_t SbdpEventKind;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * The stages of a request.
 */
enum SbdpStage
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Building distance fields.
     */
    SBDP_STAGE_SDF = 0,
    /**
     * Searching and verifying.
     */
    SBDP_STAGE_SEARCH = 1,
    /**
     * Finding the paths to where insertions begin.
     */
    SBDP_STAGE_TRANSFER = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpStage SbdpStage;
#else
typedef uint32_t SbdpStage;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * Where a step leaves its parts.
 */
enum SbdpStepEnd
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Clear of everything that they stood with.
     */
    SBDP_STEP_END_OUT = 0,
    /**
     * Elsewhere among the others, where they stay until a later step moves them again.
     */
    SBDP_STEP_END_ASIDE = 1,
    /**
     * In their places: in assembly plans.
     */
    SBDP_STEP_END_IN = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpStepEnd SbdpStepEnd;
#else
typedef uint32_t SbdpStepEnd;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * How planning ended.
 */
enum SbdpPlanStatus
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : uint32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
    /**
     * Every requested part is out.
     */
    SBDP_PLAN_STATUS_COMPLETE = 0,
    /**
     * A budget was spent; the steps are the best so far.
     */
    SBDP_PLAN_STATUS_PARTIAL = 1,
    /**
     * It is proved that some parts cannot come off.
     */
    SBDP_PLAN_STATUS_INFEASIBLE = 2,
    /**
     * The deadline passed.
     */
    SBDP_PLAN_STATUS_TIMEOUT = 3,
    /**
     * The request was cancelled.
     */
    SBDP_PLAN_STATUS_CANCELLED = 4,
    /**
     * The search found nothing more to try, and nothing was proved.
     */
    SBDP_PLAN_STATUS_EXHAUSTED = 5,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum SbdpPlanStatus SbdpPlanStatus;
#else
typedef uint32_t SbdpPlanStatus;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

/**
 * A client of one daemon. Threads may share it. It receives one plan at a time: connect several clients for more.
 */
typedef struct SbdpClient SbdpClient;

/**
 * Meshes that the library keeps, and uploads whenever the daemon does not know them, for example after a restart.
 */
typedef struct SbdpMeshes SbdpMeshes;

/**
 * A finished plan. Several threads may read it at the same time.
 */
typedef struct SbdpPlan SbdpPlan;

/**
 * An assembly that is being taken apart: what has happened to it, and plans for the rest. For one thread at a time.
 */
typedef struct SbdpSession SbdpSession;

/**
 * A plan as it arrives, for one thread at a time. Freeing it cancels the request. It may outlive its client.
 */
typedef struct SbdpStream SbdpStream;

/**
 * How to find the daemon, and how long to wait for it. All zero except `struct_size` is the default, as is a null
 * pointer.
 */
typedef struct SbdpConnectOptions {
    /**
     * `sizeof` this struct. Fields beyond it have their defaults.
     */
    uint32_t struct_size;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * The daemon's runtime folder; null for `$SBDP_RUNTIME_DIR`, else `$XDG_RUNTIME_DIR/sbdp`, else `/tmp/sbdp-UID`.
     */
    const char *runtime_dir;
    /**
     * How long the daemon may take for an answer that needs no planning; null for 10 s.
     */
    const uint64_t *timeout_ns;
    /**
     * How long the daemon may take to check and heal an upload; null for 300 s.
     */
    const uint64_t *upload_timeout_ns;
    /**
     * How long to wait for a new daemon when the one in use goes away; null for 10 s, 0 to report it at once.
     */
    const uint64_t *reconnect_ns;
    /**
     * For how long to repeat a request automatically while the daemon is busy; null for not at all.
     */
    const uint64_t *busy_wait_ns;
    /**
     * How long to poll for an answer before going to sleep; null for the default, 0 for not at all.
     */
    const uint64_t *poll_ns;
    /**
     * Called at least every 50 ms by calls that wait for the daemon, on their thread; not by `sbdp_stream_poll` and
     * `sbdp_stream_next` while the daemon plans. Not 0 ends the call with `SBDP_CODE_INTERRUPTED`. It must not throw,
     * and must live as long as the client and its streams and sessions. May be null.
     */
    int32_t (*interrupt)(void *data);
    /**
     * The argument of `interrupt`.
     */
    void *interrupt_data;
} SbdpConnectOptions;

/**
 * An error. The caller owns it; its size never changes.
 */
typedef struct SbdpError {
    /**
     * A `SbdpCode`.
     */
    uint32_t code;
    /**
     * For `SBDP_CODE_BUSY`: milliseconds to wait before the next try; otherwise 0.
     */
    uint32_t retry_ms;
    /**
     * What happened and what to do: UTF-8, ended by a zero byte, empty on success. A longer message is cut, and
     * ends in `...`.
     */
    char message[2040];
} SbdpError;

/**
 * A part: a closed mesh at its assembled pose. The arrays are read only during the call, and written once, into shared
 * memory.
 */
typedef struct SbdpPart {
    /**
     * Its name, unique in the assembly, in UTF-8.
     */
    const char *name;
    /**
     * Vertices in double precision, x, y, z each; or null.
     */
    const double *vertices_f64;
    /**
     * Vertices in single precision, where those in double precision are null.
     */
    const float *vertices_f32;
    /**
     * How many vertices: a third of the numbers.
     */
    size_t vertex_count;
    /**
     * Three vertices each, counter-clockwise from outside.
     */
    const uint32_t *triangles;
    /**
     * How many triangles: a third of the numbers.
     */
    size_t triangle_count;
} SbdpPart;

/**
 * An assembly. Part numbers are indices into its list of parts; list them in natural order of their names.
 */
typedef struct SbdpAssembly {
    /**
     * `sizeof` this struct. Fields beyond it count as zero.
     */
    uint32_t struct_size;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * A name for display, or null. It is not part of the content.
     */
    const char *name;
    /**
     * The unit of length, as `mm`, or null.
     */
    const char *units;
    /**
     * The parts.
     */
    const struct SbdpPart *parts;
    /**
     * How many.
     */
    size_t part_count;
    /**
     * Names of parts that may not move.
     */
    const char *const *fixed;
    /**
     * How many.
     */
    size_t fixed_count;
} SbdpAssembly;

/**
 * The name of an assembly: the hash of its content.
 */
typedef struct SbdpHandle {
    /**
     * The hash.
     */
    uint8_t bytes[32];
} SbdpHandle;

/**
 * A part that stands elsewhere: the rigid motion of its mesh from where it was uploaded.
 */
typedef struct SbdpMovedPart {
    /**
     * The part.
     */
    uint32_t part;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * The shift x, y, z, then the unit quaternion w, x, y, z.
     */
    double motion[7];
} SbdpMovedPart;

/**
 * Changes of an assembly that the daemon knows.
 */
typedef struct SbdpChange {
    /**
     * `sizeof` this struct. Fields beyond it count as zero.
     */
    uint32_t struct_size;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * Numbers of the parts with another mesh.
     */
    const uint32_t *replaced;
    /**
     * Their meshes, given at the assembled pose. Names stay: the ones given here are ignored.
     */
    const struct SbdpPart *replaced_by;
    /**
     * How many of both.
     */
    size_t replaced_count;
    /**
     * Further parts; they get the numbers after all others.
     */
    const struct SbdpPart *added;
    /**
     * How many.
     */
    size_t added_count;
    /**
     * Parts that stand elsewhere: the motion of the (new) mesh from where it was.
     */
    const struct SbdpMovedPart *moved;
    /**
     * How many.
     */
    size_t moved_count;
} SbdpChange;

/**
 * A verified step. The library owns it and everything that it points to. Later versions may add fields at its end, so
 * copy fields, not the struct.
 */
typedef struct SbdpStep {
    /**
     * Its number; the first is 0.
     */
    uint32_t number;
    /**
     * The number of the step that removes (in an assembly plan: inserts) the group to which these parts
     * belong; `UINT32_MAX` for none. A group is taken apart as it stood in the assembly.
     */
    uint32_t of;
    /**
     * A `SbdpStepEnd`.
     */
    uint32_t ends;
    /**
     * The earliest round, from 0, in which it can be done, if every step is done as soon as possible.
     */
    uint32_t wave;
    /**
     * Whether the path turns the parts.
     */
    bool rotates;
    /**
     * Whether the last leg of the path has a `direction`: it does not only turn.
     */
    bool has_direction;
    /**
     * The parts that move, as one body.
     */
    const uint32_t *parts;
    /**
     * How many.
     */
    size_t part_count;
    /**
     * Their motions from where they stand when the step begins (in an assembly plan: when it ends), so that the
     * first (the last) is the identity. A motion is the shift x, y, z, then the unit quaternion w, x, y, z.
     */
    const double (*path)[7];
    /**
     * How many.
     */
    size_t waypoint_count;
    /**
     * Numbers of the steps that must be done before this exact path is free, ascending.
     */
    const uint32_t *required;
    /**
     * How many.
     */
    size_t required_count;
    /**
     * The deepest overlap along the path beyond that of the assembled pose, in the input's units.
     */
    double verified_depth;
    /**
     * The unit vector of the path's last leg, in the input's frame.
     */
    double direction[3];
} SbdpStep;

/**
 * Several parts.
 */
typedef struct SbdpGroup {
    /**
     * The parts.
     */
    const uint32_t *parts;
    /**
     * How many.
     */
    size_t part_count;
} SbdpGroup;

/**
 * Parts that can begin to move together where nothing leaves.
 */
typedef struct SbdpFreeGroup {
    /**
     * The parts.
     */
    const uint32_t *parts;
    /**
     * How many.
     */
    size_t part_count;
    /**
     * The unit vector along which they begin, in the input's frame.
     */
    double direction[3];
} SbdpFreeGroup;

/**
 * Why a part that remains did not move.
 */
typedef struct SbdpBlocked {
    /**
     * The part.
     */
    uint32_t part;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * The parts that block it.
     */
    const uint32_t *by;
    /**
     * How many.
     */
    size_t by_count;
    /**
     * The action, as `+x`.
     */
    const char *action;
} SbdpBlocked;

/**
 * A pair that overlaps at the assembled pose.
 */
typedef struct SbdpOverlap {
    /**
     * The two parts, smaller number first.
     */
    uint32_t parts[2];
    /**
     * How deep, in the input's units.
     */
    double depth;
} SbdpOverlap;

/**
 * A finding about the input.
 */
typedef struct SbdpWarning {
    /**
     * The part that it is about; `UINT32_MAX` for none.
     */
    uint32_t part;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * What was found, and what was done about it.
     */
    const char *message;
} SbdpWarning;

/**
 * Counters, and times in seconds.
 */
typedef struct SbdpStats {
    /**
     * Uses of the transition function by the search, remembered ones included.
     */
    uint64_t simulations;
    /**
     * Uses of the transition function that were computed.
     */
    uint64_t simulations_run;
    /**
     * Straight sweeps that proved a removal without simulation.
     */
    uint64_t sweeps;
    /**
     * States kept.
     */
    uint64_t states;
    /**
     * Building or loading distance fields.
     */
    double sdf_time_s;
    /**
     * Building blocking graphs.
     */
    double static_analysis_time_s;
    /**
     * Simulation.
     */
    double path_time_s;
    /**
     * Shortening and verification.
     */
    double verify_time_s;
    /**
     * From admission to the last step.
     */
    double total_time_s;
    /**
     * Distance fields found in the cache.
     */
    uint64_t sdf_hits;
    /**
     * Blocking relations found in the cache.
     */
    uint64_t blocking_hits;
    /**
     * States whose blocking graphs were found in the cache.
     */
    uint64_t graph_hits;
    /**
     * Motions found in the cache.
     */
    uint64_t motion_hits;
    /**
     * 1 if the whole plan was found in the cache.
     */
    uint64_t plan_hit;
} SbdpStats;

/**
 * Everything about a plan except its steps. The library owns it and everything that it points to. Later versions may
 * add fields at its end. Texts are UTF-8.
 */
typedef struct SbdpSummary {
    /**
     * A `SbdpPlanStatus`.
     */
    uint32_t status;
    /**
     * How many steps there were.
     */
    uint32_t steps;
    /**
     * Whether it is an assembly plan.
     */
    bool assembly;
    /**
     * Whether the request named targets.
     */
    bool has_targets;
    /**
     * Why it is not complete, or null.
     */
    const char *reason;
    /**
     * The planner's name.
     */
    const char *planner;
    /**
     * The engine's name.
     */
    const char *engine;
    /**
     * The unit of length, or null.
     */
    const char *units;
    /**
     * Part names.
     */
    const char *const *parts;
    /**
     * How many.
     */
    size_t part_count;
    /**
     * Parts that had been removed before.
     */
    const uint32_t *removed;
    /**
     * How many.
     */
    size_t removed_count;
    /**
     * Parts that must come out.
     */
    const uint32_t *targets;
    /**
     * How many.
     */
    size_t target_count;
    /**
     * Parts that may not move.
     */
    const uint32_t *fixed;
    /**
     * How many.
     */
    size_t fixed_count;
    /**
     * Parts that were to stay unless others could not leave otherwise.
     */
    const uint32_t *keep;
    /**
     * How many.
     */
    size_t keep_count;
    /**
     * The base: the parts that the rest is taken off.
     */
    const uint32_t *base;
    /**
     * How many.
     */
    size_t base_count;
    /**
     * Why the base was chosen; null where the request named it.
     */
    const char *base_reason;
    /**
     * Parts that are in the assembly at the end (in an assembly plan: from the start).
     */
    const uint32_t *remaining;
    /**
     * How many.
     */
    size_t remaining_count;
    /**
     * Groups that left together and were not taken apart.
     */
    const struct SbdpGroup *kept_together;
    /**
     * How many.
     */
    size_t kept_together_count;
    /**
     * Where nothing leaves any more: groups that can begin to move.
     */
    const struct SbdpFreeGroup *free_together;
    /**
     * How many.
     */
    size_t free_together_count;
    /**
     * Parts that did not begin where their mesh was given.
     */
    const struct SbdpMovedPart *poses;
    /**
     * How many.
     */
    size_t pose_count;
    /**
     * What blocks the parts that should have come off.
     */
    const struct SbdpBlocked *blocked;
    /**
     * How many.
     */
    size_t blocked_count;
    /**
     * Overlaps at the assembled pose.
     */
    const struct SbdpOverlap *overlaps;
    /**
     * How many.
     */
    size_t overlap_count;
    /**
     * Findings about the input.
     */
    const struct SbdpWarning *warnings;
    /**
     * How many.
     */
    size_t warning_count;
    /**
     * Counters and times.
     */
    struct SbdpStats stats;
} SbdpSummary;

/**
 * A parameter of the engine `penalty`.
 */
typedef struct SbdpPenalty {
    /**
     * Its index among `time-step`, `planning-time-step`, `stiffness`, `damping`, `penetration-threshold`, `force`,
     * `torque-factor`, `similar-translation`, `similar-rotation`, `longest-edge`, `yielding`, `share-of-extent`,
     * `steps-per-waypoint`, `most-blocks`, `newton-iterations`, `newton-tolerance`; the first is 0.
     */
    uint32_t parameter;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * Its value.
     */
    double value;
} SbdpPenalty;

/**
 * What to plan. All zero except `struct_size` is the default, as is a null pointer. Where zero would have a meaning
 * of its own, the field is a pointer, and null is the default.
 */
typedef struct SbdpPlanOptions {
    /**
     * `sizeof` this struct. Fields beyond it have their defaults.
     */
    uint32_t struct_size;
    /**
     * A `SbdpPlanner`.
     */
    uint32_t planner;
    /**
     * A `SbdpEngine`.
     */
    uint32_t engine;
    /**
     * A `SbdpActions`.
     */
    uint32_t actions;
    /**
     * A `SbdpStaticAnalysis`.
     */
    uint32_t static_analysis;
    /**
     * A `SbdpChoice`: whether parts that leave straight are removed without simulation.
     */
    uint32_t sweeps;
    /**
     * A `SbdpStaging`.
     */
    uint32_t staging;
    /**
     * The number of threads; 0 leaves it to the daemon.
     */
    uint32_t threads;
    /**
     * Not 0: neither read nor write the cache.
     */
    uint32_t no_cache;
    /**
     * Not 0: other requests come first.
     */
    uint32_t batch;
    /**
     * Not 0: send the events of the search, too. The search then runs even if the plan is remembered.
     */
    uint32_t trace;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * Seed of the random poses of the planners with trees.
     */
    uint64_t seed;
    /**
     * Time from now after which the daemon answers with the plan so far; null for none.
     */
    const uint64_t *timeout_ns;
    /**
     * Time of planning, not counting waiting, after which the daemon answers with the plan so far; null for none.
     */
    const uint64_t *planning_timeout_ns;
    /**
     * Time after which one motion is given up; null for none. The plan is not remembered.
     */
    const uint64_t *path_timeout_ns;
    /**
     * Simulations after which to give up; null for no limit.
     */
    const uint64_t *max_simulations;
    /**
     * The gap with which a path out ends, in the input's units; null for a hundredth of the part's longest side.
     */
    const double *end_gap;
    /**
     * The direction up, three numbers, of any length but 0; null for the one in which most parts can go at first.
     */
    const double *up;
    /**
     * Parts that may not move.
     */
    const uint32_t *fixed;
    /**
     * How many.
     */
    size_t fixed_count;
    /**
     * Parts that are already removed.
     */
    const uint32_t *removed;
    /**
     * How many.
     */
    size_t removed_count;
    /**
     * Parts that must come out; null for all.
     */
    const uint32_t *targets;
    /**
     * How many.
     */
    size_t target_count;
    /**
     * Parts that stay as long as others leave. If there are none, the daemon chooses.
     */
    const uint32_t *base;
    /**
     * How many.
     */
    size_t base_count;
    /**
     * Groups that should leave as wholes, to be taken apart afterwards.
     */
    const struct SbdpGroup *groups;
    /**
     * How many.
     */
    size_t group_count;
    /**
     * Parts that stand elsewhere than in the assembly.
     */
    const struct SbdpMovedPart *moved;
    /**
     * How many.
     */
    size_t moved_count;
    /**
     * With `SBDP_STAGING_BESIDE`: parts that wait at given poses.
     */
    const struct SbdpMovedPart *staged;
    /**
     * How many.
     */
    size_t staged_count;
    /**
     * Parameters of the engine `penalty` that differ from the paper's.
     */
    const struct SbdpPenalty *penalty;
    /**
     * How many.
     */
    size_t penalty_count;
    /**
     * Parts that stay unless others that are asked for cannot leave otherwise. They are not asked for.
     */
    const uint32_t *keep;
    /**
     * How many.
     */
    size_t keep_count;
    /**
     * What to report about each step besides its path: the sum of some `SbdpReport`s. `sbdp_plan_json` has the reports.
     */
    uint32_t reports;
    /**
     * Not 0: put the steps into an order in which few parts have to be held at once. They then come when it is known.
     */
    uint32_t steady;
    /**
     * With `steady`: how many parts hands can hold at once, the one that moves included; 0 for any number. The plan ends
     * before the first step that needs more.
     */
    uint32_t hands;
    /**
     * Zero.
     */
    uint32_t reserved_hands;
    /**
     * With `SBDP_REPORT_STABILITY` or `steady`: the coefficient of friction of all contacts; null for 0.2.
     */
    const double *friction;
    /**
     * With `SBDP_REPORT_STABILITY` or `steady`: the direction against gravity, three numbers, of any length but 0; null for `up`, and
     * without that for +z.
     */
    const double *against_gravity;
    /**
     * Parts that are in the way and do not come apart, as a fixture or a table: they may not move, and are no base.
     */
    const uint32_t *keep_out;
    /**
     * How many.
     */
    size_t keep_out_count;
    /**
     * The distance that parts keep from what they pass on their way, in the input's units, at least 0. Pairs that are nearer as
     * they stand keep half of what they have; those that touch as they stand may touch.
     */
    double clearance;
} SbdpPlanOptions;

/**
 * What the daemon is doing. Some samples are dropped on purpose.
 */
typedef struct SbdpProgress {
    /**
     * A `SbdpStage`.
     */
    uint32_t stage;
    /**
     * Units of the stage done.
     */
    uint32_t done;
    /**
     * Units of the stage in all.
     */
    uint32_t total;
    /**
     * What the search tries: 1 + the index of the part, plus 2³¹ if the part is turned and not only pushed; 0 if that
     * is not known.
     */
    uint32_t tried;
    /**
     * Simulations so far.
     */
    uint64_t simulations;
} SbdpProgress;

/**
 * An event. It and everything that it points to is valid until the next call on the stream. Later versions may add
 * fields at its end.
 */
typedef struct SbdpEvent {
    /**
     * A `SbdpEventKind`.
     */
    uint32_t kind;
    /**
     * Zero.
     */
    uint32_t reserved;
    /**
     * The step, or null.
     */
    const struct SbdpStep *step;
    /**
     * Whole lines with one JSON object each, or null.
     */
    const char *trace;
    /**
     * The summary, or null. It is valid until the stream is freed.
     */
    const struct SbdpSummary *summary;
    /**
     * The progress; all zero for other events.
     */
    struct SbdpProgress progress;
} SbdpEvent;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Connects to a daemon. `options` may be null.
 *
 * # Safety
 * `options` is null or valid with everything that it points to; `client` and `error` are null or writable.
 */
SbdpCode sbdp_client_connect(const struct SbdpConnectOptions *options,
                             struct SbdpClient **client,
                             struct SbdpError *error);

/**
 * Frees a client. Its streams and sessions remain valid.
 *
 * # Safety
 * `client` is null, or points to null or to a client of this library that no other call uses.
 */
void sbdp_client_free(struct SbdpClient **client);

/**
 * Uploads an assembly. One that the daemon knows is not copied again.
 *
 * # Safety
 * All pointers are valid; `handle` and `error` can be written.
 */
SbdpCode sbdp_client_upload(const struct SbdpClient *client,
                            const struct SbdpAssembly *assembly,
                            struct SbdpHandle *handle,
                            struct SbdpError *error);

/**
 * Whether the daemon knows an assembly.
 *
 * # Safety
 * All pointers are valid; `known` and `error` can be written.
 */
SbdpCode sbdp_client_knows(const struct SbdpClient *client,
                           const struct SbdpHandle *handle,
                           bool *known,
                           struct SbdpError *error);

/**
 * Uploads the changes of an assembly that the daemon knows. `revised` receives the handle of the changed assembly.
 *
 * # Safety
 * All pointers are valid; `revised` and `error` can be written.
 */
SbdpCode sbdp_client_revise(const struct SbdpClient *client,
                            const struct SbdpHandle *base,
                            const struct SbdpChange *change,
                            struct SbdpHandle *revised,
                            struct SbdpError *error);

/**
 * All metrics of the daemon: a JSON object, to be freed by `sbdp_text_free`.
 *
 * # Safety
 * `client` is one of this library's; `metrics` and `error` can be written.
 */
SbdpCode sbdp_client_metrics(const struct SbdpClient *client, char **metrics, struct SbdpError *error);

/**
 * Frees a text of this library.
 *
 * # Safety
 * `text` is null, or points to null or to a text of `sbdp_client_metrics`.
 */
void sbdp_text_free(char **text);

/**
 * The daemon's process id; 0 for a null client.
 *
 * # Safety
 * `client` is null or one of this library's.
 */
uint32_t sbdp_client_daemon_pid(const struct SbdpClient *client);

/**
 * How often this client has followed a daemon that was restarted; 0 for a null client.
 *
 * # Safety
 * `client` is null or one of this library's.
 */
uint32_t sbdp_client_restarts(const struct SbdpClient *client);

/**
 * Copies an assembly, for `sbdp_client_plan_meshes`, which uploads it when necessary.
 *
 * # Safety
 * `assembly` is valid with everything that it points to; `meshes` and `error` are null or writable.
 */
SbdpCode sbdp_meshes_copy(const struct SbdpAssembly *assembly, struct SbdpMeshes **meshes, struct SbdpError *error);

/**
 * The handle of meshes.
 *
 * # Safety
 * `meshes` is one of this library's; `handle` and `error` can be written.
 */
SbdpCode sbdp_meshes_handle(const struct SbdpMeshes *meshes, struct SbdpHandle *handle, struct SbdpError *error);

/**
 * Frees meshes. Plans and sessions about them remain valid.
 *
 * # Safety
 * `meshes` is null, or points to null or to meshes of this library.
 */
void sbdp_meshes_free(struct SbdpMeshes **meshes);

/**
 * How many steps a plan has; 0 for a null plan.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
size_t sbdp_plan_step_count(const struct SbdpPlan *plan);

/**
 * A step, valid until the plan is freed; null if there is none of this number.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
const struct SbdpStep *sbdp_plan_step(const struct SbdpPlan *plan, size_t number);

/**
 * Everything about a plan except its steps, valid until it is freed; null for a null plan.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
const struct SbdpSummary *sbdp_plan_summary(const struct SbdpPlan *plan);

/**
 * Events of the search, if they were requested: whole lines with one JSON object each, valid until the plan is freed;
 * null for a null plan.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
const char *sbdp_plan_trace(const struct SbdpPlan *plan);

/**
 * The plan as the command line writes it: JSON (`sbdp-plan/2`) in a line with its end, without what only the files of an
 * assembly have (`source`, `groups`, findings while reading). `json` is valid until the plan is freed.
 *
 * # Safety
 * `plan` is one of this library's; `json` and `error` can be written.
 */
SbdpCode sbdp_plan_json(const struct SbdpPlan *plan,
                        const char **json,
                        struct SbdpError *error);

/**
 * Frees a plan.
 *
 * # Safety
 * `plan` is null, or points to null or to a plan of this library.
 */
void sbdp_plan_free(struct SbdpPlan **plan);

/**
 * Begins a session about an uploaded assembly. Sends nothing yet. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `session` and `error` can be written.
 */
SbdpCode sbdp_client_session(const struct SbdpClient *client,
                             const struct SbdpHandle *handle,
                             const struct SbdpPlanOptions *options,
                             struct SbdpSession **session,
                             struct SbdpError *error);

/**
 * Begins a session about meshes, which are uploaded whenever the daemon does not know them. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `session` and `error` can be written.
 */
SbdpCode sbdp_client_session_meshes(const struct SbdpClient *client,
                                    const struct SbdpMeshes *meshes,
                                    const struct SbdpPlanOptions *options,
                                    struct SbdpSession **session,
                                    struct SbdpError *error);

/**
 * The number of a part, of a session about meshes.
 *
 * # Safety
 * All pointers are valid; `part` and `error` can be written.
 */
SbdpCode sbdp_session_part(const struct SbdpSession *session,
                           const char *name,
                           uint32_t *part,
                           struct SbdpError *error);

/**
 * Records that these parts are out.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_executed(struct SbdpSession *session,
                               const uint32_t *parts,
                               size_t part_count,
                               struct SbdpError *error);

/**
 * Records that a step of the last plan was done: its parts are out, or stand where the step left them.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_performed(struct SbdpSession *session, const struct SbdpStep *step, struct SbdpError *error);

/**
 * Records that this part does not move: until it is freed, plans leave it in place. It is no longer a target.
 *
 * # Safety
 * `session` is one of this library's that no other call uses; `error` can be written.
 */
SbdpCode sbdp_session_stuck(struct SbdpSession *session, uint32_t part, struct SbdpError *error);

/**
 * Records that this part moves again.
 *
 * # Safety
 * `session` is one of this library's that no other call uses; `error` can be written.
 */
SbdpCode sbdp_session_freed(struct SbdpSession *session, uint32_t part, struct SbdpError *error);

/**
 * Records that this part stands elsewhere.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_moved(struct SbdpSession *session, const struct SbdpMovedPart *moved, struct SbdpError *error);

/**
 * From the next plan on: time after which the daemon answers with the plan so far; null for none.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_set_timeout(struct SbdpSession *session, const uint64_t *timeout_ns, struct SbdpError *error);

/**
 * Plans how the rest comes apart from how it stands now.
 *
 * # Safety
 * `session` is one of this library's that no other call uses; `stream` and `error` can be written.
 */
SbdpCode sbdp_session_replan(struct SbdpSession *session, struct SbdpStream **stream, struct SbdpError *error);

/**
 * Frees a session. Its streams remain valid.
 *
 * # Safety
 * `session` is null, or points to null or to a session of this library that no other call uses.
 */
void sbdp_session_free(struct SbdpSession **session);

/**
 * Keeps a step beyond the next call on its stream, or beyond its plan; to be freed by `sbdp_step_free`. Nothing is
 * copied.
 *
 * # Safety
 * `step` is one of this library's that is still valid; `kept` and `error` can be written.
 */
SbdpCode sbdp_step_keep(const struct SbdpStep *step, struct SbdpStep **kept, struct SbdpError *error);

/**
 * Frees a step that was kept.
 *
 * # Safety
 * `step` is null, or points to null or to a step of `sbdp_step_keep`.
 */
void sbdp_step_free(struct SbdpStep **step);

/**
 * Requests a plan of an uploaded assembly. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `stream` and `error` can be written.
 */
SbdpCode sbdp_client_plan(const struct SbdpClient *client,
                          const struct SbdpHandle *handle,
                          const struct SbdpPlanOptions *options,
                          struct SbdpStream **stream,
                          struct SbdpError *error);

/**
 * Requests a plan of meshes, which are uploaded whenever the daemon does not know them. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `stream` and `error` can be written.
 */
SbdpCode sbdp_client_plan_meshes(const struct SbdpClient *client,
                                 const struct SbdpMeshes *meshes,
                                 const struct SbdpPlanOptions *options,
                                 struct SbdpStream **stream,
                                 struct SbdpError *error);

/**
 * Reads steps in shared memory from now on, without a copy. Steps of two messages may then be kept; a call that needs
 * a third fails with `SBDP_CODE_VIEWS_HELD`, and nothing is lost.
 *
 * # Safety
 * `stream` is one of this library's; `error` can be written.
 */
SbdpCode sbdp_stream_read_in_place(struct SbdpStream *stream, struct SbdpError *error);

/**
 * Waits for the next event, as long as the daemon lives; `SBDP_EVENT_KIND_END` after the end. After an error the
 * stream is over, except after `SBDP_CODE_VIEWS_HELD`.
 *
 * # Safety
 * `stream` is one of this library's that no other call uses; `event` and `error` can be written.
 */
SbdpCode sbdp_stream_next(struct SbdpStream *stream, const struct SbdpEvent **event, struct SbdpError *error);

/**
 * The next event if it arrives within a time, which may be 0; otherwise `SBDP_EVENT_KIND_PENDING`.
 *
 * # Safety
 * As `sbdp_stream_next`.
 */
SbdpCode sbdp_stream_poll(struct SbdpStream *stream,
                          uint64_t within_ns,
                          const struct SbdpEvent **event,
                          struct SbdpError *error);

/**
 * Asks the daemon to stop soon. The stream continues until its end, whose status is then `cancelled`, unless the plan
 * was ready before.
 *
 * # Safety
 * `stream` is one of this library's that no other call uses; `error` can be written.
 */
SbdpCode sbdp_stream_cancel(struct SbdpStream *stream, struct SbdpError *error);

/**
 * Waits for the end of the plan and keeps everything. Frees the stream, also after an error.
 *
 * # Safety
 * `stream` points to a stream of this library that no other call uses; `plan` and `error` can be written.
 */
SbdpCode sbdp_stream_to_end(struct SbdpStream **stream, struct SbdpPlan **plan, struct SbdpError *error);

/**
 * Frees a stream, and cancels its request if it has not ended.
 *
 * # Safety
 * `stream` is null, or points to null or to a stream of this library that no other call uses.
 */
void sbdp_stream_free(struct SbdpStream **stream);

/**
 * Connects to a daemon. `options` may be null.
 *
 * # Safety
 * `options` is null or valid with everything that it points to; `client` and `error` are null or writable.
 */
SbdpCode sbdp_client_connect(const struct SbdpConnectOptions *options,
                             struct SbdpClient **client,
                             struct SbdpError *error);

/**
 * Frees a client. Its streams and sessions remain valid.
 *
 * # Safety
 * `client` is null, or points to null or to a client of this library that no other call uses.
 */
void sbdp_client_free(struct SbdpClient **client);

/**
 * Uploads an assembly. One that the daemon knows is not copied again.
 *
 * # Safety
 * All pointers are valid; `handle` and `error` can be written.
 */
SbdpCode sbdp_client_upload(const struct SbdpClient *client,
                            const struct SbdpAssembly *assembly,
                            struct SbdpHandle *handle,
                            struct SbdpError *error);

/**
 * Whether the daemon knows an assembly.
 *
 * # Safety
 * All pointers are valid; `known` and `error` can be written.
 */
SbdpCode sbdp_client_knows(const struct SbdpClient *client,
                           const struct SbdpHandle *handle,
                           bool *known,
                           struct SbdpError *error);

/**
 * Uploads the changes of an assembly that the daemon knows. `revised` receives the handle of the changed assembly.
 *
 * # Safety
 * All pointers are valid; `revised` and `error` can be written.
 */
SbdpCode sbdp_client_revise(const struct SbdpClient *client,
                            const struct SbdpHandle *base,
                            const struct SbdpChange *change,
                            struct SbdpHandle *revised,
                            struct SbdpError *error);

/**
 * All metrics of the daemon: a JSON object, to be freed by `sbdp_text_free`.
 *
 * # Safety
 * `client` is one of this library's; `metrics` and `error` can be written.
 */
SbdpCode sbdp_client_metrics(const struct SbdpClient *client, char **metrics, struct SbdpError *error);

/**
 * Frees a text of this library.
 *
 * # Safety
 * `text` is null, or points to null or to a text of `sbdp_client_metrics`.
 */
void sbdp_text_free(char **text);

/**
 * The daemon's process id; 0 for a null client.
 *
 * # Safety
 * `client` is null or one of this library's.
 */
uint32_t sbdp_client_daemon_pid(const struct SbdpClient *client);

/**
 * How often this client has followed a daemon that was restarted; 0 for a null client.
 *
 * # Safety
 * `client` is null or one of this library's.
 */
uint32_t sbdp_client_restarts(const struct SbdpClient *client);

/**
 * Copies an assembly, for `sbdp_client_plan_meshes`, which uploads it when necessary.
 *
 * # Safety
 * `assembly` is valid with everything that it points to; `meshes` and `error` are null or writable.
 */
SbdpCode sbdp_meshes_copy(const struct SbdpAssembly *assembly, struct SbdpMeshes **meshes, struct SbdpError *error);

/**
 * The handle of meshes.
 *
 * # Safety
 * `meshes` is one of this library's; `handle` and `error` can be written.
 */
SbdpCode sbdp_meshes_handle(const struct SbdpMeshes *meshes, struct SbdpHandle *handle, struct SbdpError *error);

/**
 * Frees meshes. Plans and sessions about them remain valid.
 *
 * # Safety
 * `meshes` is null, or points to null or to meshes of this library.
 */
void sbdp_meshes_free(struct SbdpMeshes **meshes);

/**
 * How many steps a plan has; 0 for a null plan.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
size_t sbdp_plan_step_count(const struct SbdpPlan *plan);

/**
 * A step, valid until the plan is freed; null if there is none of this number.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
const struct SbdpStep *sbdp_plan_step(const struct SbdpPlan *plan, size_t number);

/**
 * Everything about a plan except its steps, valid until it is freed; null for a null plan.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
const struct SbdpSummary *sbdp_plan_summary(const struct SbdpPlan *plan);

/**
 * Events of the search, if they were requested: whole lines with one JSON object each, valid until the plan is freed;
 * null for a null plan.
 *
 * # Safety
 * `plan` is null or one of this library's.
 */
const char *sbdp_plan_trace(const struct SbdpPlan *plan);

/**
 * The plan as the command line writes it: JSON (`sbdp-plan/2`) in a line with its end, without what only the files of an
 * assembly have (`source`, `groups`, findings while reading). `json` is valid until the plan is freed.
 *
 * # Safety
 * `plan` is one of this library's; `json` and `error` can be written.
 */
SbdpCode sbdp_plan_json(const struct SbdpPlan *plan,
                        const char **json,
                        struct SbdpError *error);

/**
 * Frees a plan.
 *
 * # Safety
 * `plan` is null, or points to null or to a plan of this library.
 */
void sbdp_plan_free(struct SbdpPlan **plan);

/**
 * Begins a session about an uploaded assembly. Sends nothing yet. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `session` and `error` can be written.
 */
SbdpCode sbdp_client_session(const struct SbdpClient *client,
                             const struct SbdpHandle *handle,
                             const struct SbdpPlanOptions *options,
                             struct SbdpSession **session,
                             struct SbdpError *error);

/**
 * Begins a session about meshes, which are uploaded whenever the daemon does not know them. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `session` and `error` can be written.
 */
SbdpCode sbdp_client_session_meshes(const struct SbdpClient *client,
                                    const struct SbdpMeshes *meshes,
                                    const struct SbdpPlanOptions *options,
                                    struct SbdpSession **session,
                                    struct SbdpError *error);

/**
 * The number of a part, of a session about meshes.
 *
 * # Safety
 * All pointers are valid; `part` and `error` can be written.
 */
SbdpCode sbdp_session_part(const struct SbdpSession *session,
                           const char *name,
                           uint32_t *part,
                           struct SbdpError *error);

/**
 * Records that these parts are out.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_executed(struct SbdpSession *session,
                               const uint32_t *parts,
                               size_t part_count,
                               struct SbdpError *error);

/**
 * Records that a step of the last plan was done: its parts are out, or stand where the step left them.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_performed(struct SbdpSession *session, const struct SbdpStep *step, struct SbdpError *error);

/**
 * Records that this part does not move: until it is freed, plans leave it in place. It is no longer a target.
 *
 * # Safety
 * `session` is one of this library's that no other call uses; `error` can be written.
 */
SbdpCode sbdp_session_stuck(struct SbdpSession *session, uint32_t part, struct SbdpError *error);

/**
 * Records that this part moves again.
 *
 * # Safety
 * `session` is one of this library's that no other call uses; `error` can be written.
 */
SbdpCode sbdp_session_freed(struct SbdpSession *session, uint32_t part, struct SbdpError *error);

/**
 * Records that this part stands elsewhere.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_moved(struct SbdpSession *session, const struct SbdpMovedPart *moved, struct SbdpError *error);

/**
 * From the next plan on: time after which the daemon answers with the plan so far; null for none.
 *
 * # Safety
 * All pointers are valid, and no other call uses the session; `error` can be written.
 */
SbdpCode sbdp_session_set_timeout(struct SbdpSession *session, const uint64_t *timeout_ns, struct SbdpError *error);

/**
 * Plans how the rest comes apart from how it stands now.
 *
 * # Safety
 * `session` is one of this library's that no other call uses; `stream` and `error` can be written.
 */
SbdpCode sbdp_session_replan(struct SbdpSession *session, struct SbdpStream **stream, struct SbdpError *error);

/**
 * Frees a session. Its streams remain valid.
 *
 * # Safety
 * `session` is null, or points to null or to a session of this library that no other call uses.
 */
void sbdp_session_free(struct SbdpSession **session);

/**
 * Keeps a step beyond the next call on its stream, or beyond its plan; to be freed by `sbdp_step_free`. Nothing is
 * copied.
 *
 * # Safety
 * `step` is one of this library's that is still valid; `kept` and `error` can be written.
 */
SbdpCode sbdp_step_keep(const struct SbdpStep *step, struct SbdpStep **kept, struct SbdpError *error);

/**
 * Frees a step that was kept.
 *
 * # Safety
 * `step` is null, or points to null or to a step of `sbdp_step_keep`.
 */
void sbdp_step_free(struct SbdpStep **step);

/**
 * Requests a plan of an uploaded assembly. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `stream` and `error` can be written.
 */
SbdpCode sbdp_client_plan(const struct SbdpClient *client,
                          const struct SbdpHandle *handle,
                          const struct SbdpPlanOptions *options,
                          struct SbdpStream **stream,
                          struct SbdpError *error);

/**
 * Requests a plan of meshes, which are uploaded whenever the daemon does not know them. `options` may be null.
 *
 * # Safety
 * All pointers are valid; `stream` and `error` can be written.
 */
SbdpCode sbdp_client_plan_meshes(const struct SbdpClient *client,
                                 const struct SbdpMeshes *meshes,
                                 const struct SbdpPlanOptions *options,
                                 struct SbdpStream **stream,
                                 struct SbdpError *error);

/**
 * Reads steps in shared memory from now on, without a copy. Steps of two messages may then be kept; a call that needs
 * a third fails with `SBDP_CODE_VIEWS_HELD`, and nothing is lost.
 *
 * # Safety
 * `stream` is one of this library's; `error` can be written.
 */
SbdpCode sbdp_stream_read_in_place(struct SbdpStream *stream, struct SbdpError *error);

/**
 * Waits for the next event, as long as the daemon lives; `SBDP_EVENT_KIND_END` after the end. After an error the
 * stream is over, except after `SBDP_CODE_VIEWS_HELD`.
 *
 * # Safety
 * `stream` is one of this library's that no other call uses; `event` and `error` can be written.
 */
SbdpCode sbdp_stream_next(struct SbdpStream *stream, const struct SbdpEvent **event, struct SbdpError *error);

/**
 * The next event if it arrives within a time, which may be 0; otherwise `SBDP_EVENT_KIND_PENDING`.
 *
 * # Safety
 * As `sbdp_stream_next`.
 */
SbdpCode sbdp_stream_poll(struct SbdpStream *stream,
                          uint64_t within_ns,
                          const struct SbdpEvent **event,
                          struct SbdpError *error);

/**
 * Asks the daemon to stop soon. The stream continues until its end, whose status is then `cancelled`, unless the plan
 * was ready before.
 *
 * # Safety
 * `stream` is one of this library's that no other call uses; `error` can be written.
 */
SbdpCode sbdp_stream_cancel(struct SbdpStream *stream, struct SbdpError *error);

/**
 * Waits for the end of the plan and keeps everything. Frees the stream, also after an error.
 *
 * # Safety
 * `stream` points to a stream of this library that no other call uses; `plan` and `error` can be written.
 */
SbdpCode sbdp_stream_to_end(struct SbdpStream **stream, struct SbdpPlan **plan, struct SbdpError *error);

/**
 * Frees a stream, and cancels its request if it has not ended.
 *
 * # Safety
 * `stream` is null, or points to null or to a stream of this library that no other call uses.
 */
void sbdp_stream_free(struct SbdpStream **stream);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* SBDP_H */
