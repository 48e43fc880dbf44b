/* The C contract against a daemon of its own: client_c SBDPD PLACE ROUNDS. */
#define _POSIX_C_SOURCE 200809L
#include "support.h"

static SbdpError error;

static SbdpHandle upload(const SbdpClient *client, const double *low, const double *high) {
    const SbdpPart parts[2] = {
        {.name = "low", .vertices_f64 = low, .vertex_count = 8, .triangles = CUBE, .triangle_count = 12},
        {.name = "high", .vertices_f64 = high, .vertex_count = 8, .triangles = CUBE, .triangle_count = 12},
    };
    const SbdpAssembly assembly = {.struct_size = sizeof assembly, .units = "mm", .parts = parts, .part_count = 2};
    SbdpHandle handle;
    if (sbdp_client_upload(client, &assembly, &handle, &error) != SBDP_CODE_OK) {
        fprintf(stderr, "%s\n", error.message);
        abort();
    }
    return handle;
}

/* Every function with null for everything. */
static void nulls(void) {
    const SbdpCode bad = SBDP_CODE_ARGUMENT;
    CHECK(sbdp_client_connect(NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_upload(NULL, NULL, NULL, &error) == bad);
    CHECK(strcmp(error.message, "`client` is null") == 0 && error.code == bad);
    CHECK(sbdp_client_knows(NULL, NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_revise(NULL, NULL, NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_metrics(NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_plan(NULL, NULL, NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_plan_meshes(NULL, NULL, NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_session(NULL, NULL, NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_session_meshes(NULL, NULL, NULL, NULL, NULL) == bad);
    CHECK(sbdp_meshes_copy(NULL, NULL, NULL) == bad && sbdp_meshes_handle(NULL, NULL, NULL) == bad);
    CHECK(sbdp_stream_next(NULL, NULL, NULL) == bad && sbdp_stream_poll(NULL, 0, NULL, NULL) == bad);
    CHECK(sbdp_stream_cancel(NULL, NULL) == bad && sbdp_stream_read_in_place(NULL, NULL) == bad);
    CHECK(sbdp_stream_to_end(NULL, NULL, NULL) == bad && sbdp_step_keep(NULL, NULL, NULL) == bad);
    CHECK(sbdp_session_part(NULL, NULL, NULL, NULL) == bad && sbdp_session_executed(NULL, NULL, 0, NULL) == bad);
    CHECK(sbdp_session_performed(NULL, NULL, NULL) == bad && sbdp_session_stuck(NULL, 0, NULL) == bad);
    CHECK(sbdp_session_freed(NULL, 0, NULL) == bad && sbdp_session_moved(NULL, NULL, NULL) == bad);
    CHECK(sbdp_session_set_timeout(NULL, NULL, NULL) == bad && sbdp_session_replan(NULL, NULL, NULL) == bad);
    CHECK(sbdp_client_daemon_pid(NULL) == 0 && sbdp_client_restarts(NULL) == 0);
    CHECK(sbdp_plan_step_count(NULL) == 0 && sbdp_plan_step(NULL, 0) == NULL);
    CHECK(sbdp_plan_summary(NULL) == NULL && sbdp_plan_trace(NULL) == NULL);
    const char *json = NULL;
    CHECK(sbdp_plan_json(NULL, &json, &error) == SBDP_CODE_ARGUMENT && json == NULL);
    sbdp_client_free(NULL), sbdp_meshes_free(NULL), sbdp_stream_free(NULL), sbdp_plan_free(NULL);
    sbdp_session_free(NULL), sbdp_step_free(NULL), sbdp_text_free(NULL);
    SbdpClient *none = NULL;
    sbdp_client_free(&none);
}

/* Structs of older and of newer callers. */
static void sizes(const SbdpClient *client, const SbdpHandle *handle) {
    struct {
        SbdpPlanOptions known;
        uint64_t unknown;
    } newer;
    memset(&newer, 0, sizeof newer);
    newer.known.struct_size = sizeof newer;
    SbdpStream *stream = NULL;
    SbdpPlan *plan = NULL;
    CHECK(sbdp_client_plan(client, handle, &newer.known, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_stream_to_end(&stream, &plan, &error) == SBDP_CODE_OK && stream == NULL);
    sbdp_plan_free(&plan);
    newer.unknown = 1;
    CHECK(sbdp_client_plan(client, handle, &newer.known, &stream, &error) == SBDP_CODE_ARGUMENT && stream == NULL);
    CHECK(strstr(error.message, "newer libsbdp") != NULL);
    /* Only its size and the planner: on the heap, so that reading more would be seen. */
    uint32_t *older = malloc(8);
    CHECK(older != NULL);
    older[0] = 8, older[1] = SBDP_PLANNER_SBDP;
    CHECK(sbdp_client_plan(client, handle, (const SbdpPlanOptions *)(const void *)older, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_stream_to_end(&stream, &plan, &error) == SBDP_CODE_OK);
    CHECK(strcmp(sbdp_plan_summary(plan)->planner, "sbdp") == 0);
    sbdp_plan_free(&plan);
    free(older);
    SbdpPlanOptions options = {.struct_size = 0};
    CHECK(sbdp_client_plan(client, handle, &options, &stream, &error) == SBDP_CODE_ARGUMENT);
    options.struct_size = sizeof options;
    options.planner = 99;
    CHECK(sbdp_client_plan(client, handle, &options, &stream, &error) == SBDP_CODE_ARGUMENT);
    options.planner = 0;
    options.fixed_count = 3;
    CHECK(sbdp_client_plan(client, handle, &options, &stream, &error) == SBDP_CODE_ARGUMENT);
    CHECK(strstr(error.message, "options->fixed") != NULL);
}

static void refusals(const SbdpClient *client, const SbdpHandle *handle) {
    SbdpStream *stream = NULL;
    const SbdpEvent *event = NULL;
    SbdpHandle wrong = {{7}};
    CHECK(sbdp_client_plan(client, &wrong, NULL, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_stream_next(stream, &event, &error) == SBDP_CODE_UNKNOWN_HANDLE && event == NULL);
    sbdp_stream_free(&stream);
    CHECK(stream == NULL);
    sbdp_stream_free(&stream);
    const uint32_t part = 5;
    SbdpPlanOptions options = {.struct_size = sizeof options, .removed = &part, .removed_count = 1};
    CHECK(sbdp_client_plan(client, handle, &options, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_stream_next(stream, &event, &error) == SBDP_CODE_NO_SUCH_PART);
    sbdp_stream_free(&stream);
    /* One plan at a time. */
    SbdpStream *second = NULL;
    CHECK(sbdp_client_plan(client, handle, NULL, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_client_plan(client, handle, NULL, &second, &error) == SBDP_CODE_STREAM_OPEN && second == NULL);
    sbdp_stream_free(&stream);
    /* Parts that are wrong in themselves. */
    const float narrow[3] = {0, 0, 0};
    SbdpPart part_of = {.name = "both", .vertices_f64 = (const double[3]){0, 0, 0}, .vertices_f32 = narrow, .vertex_count = 1};
    SbdpAssembly strange = {.struct_size = sizeof strange, .parts = &part_of, .part_count = 1};
    CHECK(sbdp_client_upload(client, &strange, &wrong, &error) == SBDP_CODE_ARGUMENT);
    CHECK(strstr(error.message, "`both`") != NULL);
    part_of.vertices_f64 = NULL, part_of.vertex_count = SIZE_MAX;
    CHECK(sbdp_client_upload(client, &strange, &wrong, &error) == SBDP_CODE_ARGUMENT);
    part_of.vertices_f32 = (const float *)(const void *)((const char *)narrow + 1), part_of.vertex_count = 0;
    part_of.name = "\xff";
    CHECK(sbdp_client_upload(client, &strange, &wrong, &error) == SBDP_CODE_ARGUMENT);
    CHECK(strstr(error.message, "UTF-8") != NULL);
    part_of.name = NULL;
    CHECK(sbdp_client_upload(client, &strange, &wrong, &error) == SBDP_CODE_ARGUMENT);
    /* Geometry. */
    const double flat[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const uint32_t triangle[3] = {0, 1, 9};
    const SbdpPart bad = {.name = "bad", .vertices_f64 = flat, .vertex_count = 3, .triangles = triangle, .triangle_count = 1};
    const SbdpAssembly assembly = {.struct_size = sizeof assembly, .parts = &bad, .part_count = 1};
    CHECK(sbdp_client_upload(client, &assembly, &wrong, &error) == SBDP_CODE_GEOMETRY);
    CHECK(strstr(error.message, "bad") != NULL);
}

static void steps(const SbdpClient *client, const SbdpHandle *handle, bool in_place) {
    SbdpStream *stream = NULL;
    const SbdpEvent *event = NULL;
    SbdpStep *kept = NULL;
    uint32_t count = 0;
    SbdpPlanOptions options = {.struct_size = sizeof options, .no_cache = 1, .trace = 1};
    CHECK(sbdp_client_plan(client, handle, &options, &stream, &error) == SBDP_CODE_OK);
    if (in_place) {
        CHECK(sbdp_stream_read_in_place(stream, &error) == SBDP_CODE_OK);
    }
    for (;;) {
        CHECK(sbdp_stream_next(stream, &event, &error) == SBDP_CODE_OK);
        if (event->kind == SBDP_EVENT_KIND_STEP) {
            CHECK(event->step->number == count++ && event->step->part_count == 1 && event->step->waypoint_count >= 2);
            CHECK(event->step->path[0][3] == 1.0);
            sbdp_step_free(&kept);
            CHECK(sbdp_step_keep(event->step, &kept, &error) == SBDP_CODE_OK);
        } else if (event->kind == SBDP_EVENT_KIND_DONE) {
            break;
        }
    }
    CHECK(count == 1 && event->summary->steps == 1 && event->summary->status == SBDP_PLAN_STATUS_COMPLETE);
    CHECK(event->summary->part_count == 2 && strcmp(event->summary->parts[1], "high") == 0);
    CHECK(strcmp(event->summary->units, "mm") == 0);
    CHECK(sbdp_stream_next(stream, &event, &error) == SBDP_CODE_OK && event->kind == SBDP_EVENT_KIND_END);
    sbdp_stream_free(&stream);
    CHECK(kept->number == 0 && kept->path[0][3] == 1.0 && kept->has_direction);
    sbdp_step_free(&kept);
    CHECK(kept == NULL);
}

/* A cube in a closed box: a search for a way out that only a limit ends. */
static SbdpHandle limits(const SbdpClient *client) {
    double outer[48], inner[24];
    uint32_t shell[72];
    cuboid(outer, 0, 10, 0), cuboid(outer + 24, 1, 8, 0), cuboid(inner, 4, 2, 0);
    for (int i = 0; i < 12; ++i) {
        for (int corner = 0; corner < 3; ++corner) {
            shell[3 * i + corner] = CUBE[3 * i + corner];
            shell[36 + 3 * i + corner] = 8 + CUBE[3 * i + 2 - corner];
        }
    }
    const SbdpPart parts[2] = {
        {.name = "box", .vertices_f64 = outer, .vertex_count = 16, .triangles = shell, .triangle_count = 24},
        {.name = "inside", .vertices_f64 = inner, .vertex_count = 8, .triangles = CUBE, .triangle_count = 12},
    };
    const SbdpAssembly assembly = {.struct_size = sizeof assembly, .parts = parts, .part_count = 2};
    SbdpHandle handle;
    CHECK(sbdp_client_upload(client, &assembly, &handle, &error) == SBDP_CODE_OK);
    const uint64_t deadline = 200000000;
    SbdpPlanOptions options = {.struct_size = sizeof options, .planner = SBDP_PLANNER_RRT, .no_cache = 1};
    options.timeout_ns = &deadline;
    SbdpStream *stream = NULL;
    SbdpPlan *plan = NULL;
    CHECK(sbdp_client_plan(client, &handle, &options, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_stream_to_end(&stream, &plan, &error) == SBDP_CODE_OK);
    CHECK(sbdp_plan_summary(plan)->status == SBDP_PLAN_STATUS_TIMEOUT);
    const char *json = NULL, *again = NULL;
    CHECK(sbdp_plan_json(plan, &json, &error) == SBDP_CODE_OK && sbdp_plan_json(plan, &again, &error) == SBDP_CODE_OK);
    CHECK(json == again && strstr(json, "\"status\":\"timeout\"") != NULL && json[strlen(json) - 1] == '\n');
    sbdp_plan_free(&plan);

    options.timeout_ns = NULL;
    const SbdpEvent *event = NULL;
    bool pending = false, cancelled = false;
    CHECK(sbdp_client_plan(client, &handle, &options, &stream, &error) == SBDP_CODE_OK);
    do {
        CHECK(sbdp_stream_poll(stream, 1000000, &event, &error) == SBDP_CODE_OK);
        pending = pending || event->kind == SBDP_EVENT_KIND_PENDING;
        if (pending && !cancelled) {
            CHECK(sbdp_stream_cancel(stream, &error) == SBDP_CODE_OK);
            cancelled = true;
        }
    } while (event->kind != SBDP_EVENT_KIND_DONE);
    CHECK(pending && event->summary->status == SBDP_PLAN_STATUS_CANCELLED);
    sbdp_stream_free(&stream);
    return handle;
}

static int asked;
static int interrupt(void *data) {
    ++asked;
    return *(int *)data;
}

int main(int count, char **arguments) {
    CHECK(count == 4);
    const long rounds = atol(arguments[3]);
    char run[512];
    snprintf(run, sizeof run, "%s/run", arguments[2]);
    int wanted = 0;
    const uint64_t at_once = 0;
    SbdpConnectOptions options = {.struct_size = sizeof options, .runtime_dir = run, .reconnect_ns = &at_once};
    options.interrupt = interrupt, options.interrupt_data = &wanted;
    SbdpClient *client = NULL;
    nulls();
    CHECK(sbdp_client_connect(&options, &client, &error) == SBDP_CODE_NO_DAEMON && client == NULL);
    CHECK(strstr(error.message, "start one with `sbdpd`") != NULL);

    pid_t daemon = start_daemon(arguments[1], arguments[2]);
    CHECK(sbdp_client_connect(&options, &client, &error) == SBDP_CODE_OK);
    CHECK(sbdp_client_daemon_pid(client) == (uint32_t)daemon);
    double low[24], high[24];
    cuboid(low, 0, 1, 0), cuboid(high, 0, 1, 1);
    SbdpHandle handle = upload(client, low, high);
    bool known = false;
    CHECK(sbdp_client_knows(client, &handle, &known, &error) == SBDP_CODE_OK && known);
    char *metrics = NULL;
    CHECK(sbdp_client_metrics(client, &metrics, &error) == SBDP_CODE_OK && metrics[0] == '{');
    sbdp_text_free(&metrics);
    sizes(client, &handle);
    refusals(client, &handle);
    steps(client, &handle, false);
    steps(client, &handle, true);
    const SbdpHandle boxed = limits(client);

    /* Memory is flat, once all that is kept for the next time is there. */
    double *times = malloc((size_t)rounds * sizeof *times);
    CHECK(times != NULL);
    const SbdpHandle *subject = &handle;
    long before = 0;
    for (long round = 0; round < rounds; ++round) {
        if (round == rounds / 10) {
            before = resident_kib();
        }
        SbdpStream *stream = NULL;
        SbdpPlan *plan = NULL;
        const double start = now_us();
        CHECK(sbdp_client_plan(client, subject, NULL, &stream, &error) == SBDP_CODE_OK);
        CHECK(sbdp_stream_to_end(&stream, &plan, &error) == SBDP_CODE_OK);
        CHECK(sbdp_plan_step_count(plan) == 1 && sbdp_plan_step(plan, 0)->part_count == 1);
        times[round] = now_us() - start;
        sbdp_plan_free(&plan);
    }
    const long after = resident_kib();
    printf("%ld plans: resident %ld KiB after a tenth, %ld KiB at the end\n", rounds, before, after);
    /* A leak of 200 bytes a plan would be twice as much in 10,000. */
    CHECK(after - before < 1024);
    free(times);

    /* The daemon is killed while it plans, and is missed then: the Rust client says the same. */
    SbdpStream *stream = NULL;
    SbdpPlan *plan = NULL;
    const SbdpEvent *event = NULL;
    SbdpPlanOptions endless = {.struct_size = sizeof endless, .planner = SBDP_PLANNER_RRT, .no_cache = 1};
    CHECK(sbdp_client_plan(client, &boxed, &endless, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_stream_poll(stream, 50000000, &event, &error) == SBDP_CODE_OK);
    end_daemon(daemon, SIGKILL);
    CHECK(sbdp_stream_to_end(&stream, &plan, &error) == SBDP_CODE_DAEMON_DIED && stream == NULL && plan == NULL);
    CHECK(strstr(error.message, "went away before it had answered") != NULL);
    CHECK(sbdp_client_plan(client, &handle, NULL, &stream, &error) == SBDP_CODE_NO_DAEMON && stream == NULL);
    daemon = start_daemon(arguments[1], arguments[2]);
    handle = upload(client, low, high);
    CHECK(sbdp_client_restarts(client) == 1);
    CHECK(sbdp_client_plan(client, &handle, NULL, &stream, &error) == SBDP_CODE_OK);
    CHECK(sbdp_stream_to_end(&stream, &plan, &error) == SBDP_CODE_OK);
    sbdp_plan_free(&plan);
    /* A stopped daemon gives no answer, and the caller does not want to wait. */
    CHECK(kill(daemon, SIGSTOP) == 0);
    wanted = 1;
    CHECK(sbdp_client_knows(client, &handle, &known, &error) == SBDP_CODE_INTERRUPTED && asked > 0);
    CHECK(kill(daemon, SIGCONT) == 0);
    sbdp_client_free(&client);
    CHECK(client == NULL);
    sbdp_client_free(&client);
    end_daemon(daemon, SIGTERM);
    puts("C: all as it should be");
    return 0;
}
