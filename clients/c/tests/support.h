/* What the tests in C and in C++ share: a daemon of their own, meshes, and a check. */
#ifndef SBDP_TESTS_SUPPORT_H
#define SBDP_TESTS_SUPPORT_H

#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "sbdp.h"

#define CHECK(condition)                                                                   \
    do {                                                                                   \
        if (!(condition)) {                                                                \
            fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #condition);      \
            abort();                                                                       \
        }                                                                                  \
    } while (0)

static const uint32_t CUBE[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                  2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};

static inline void cuboid(double *vertices, double low, double size, double z) {
    for (int i = 0; i < 8; ++i) {
        vertices[3 * i] = low + size * (i & 1);
        vertices[3 * i + 1] = low + size * ((i >> 1) & 1);
        vertices[3 * i + 2] = low + size * (i >> 2) + z;
    }
}

static inline pid_t start_daemon(const char *program, const char *place) {
    char run[512], root[512], prefix[64], log[512];
    snprintf(run, sizeof run, "%s/run", place);
    snprintf(root, sizeof root, "%s/root", place);
    snprintf(prefix, sizeof prefix, "sbdp-c-%d-", (int)getpid());
    snprintf(log, sizeof log, "%s/log", place);
    fflush(NULL);
    pid_t pid = fork();
    if (pid == 0) {
        /* It goes with a test that is aborted, and holds nothing of it. */
        CHECK(prctl(PR_SET_PDEATHSIG, SIGKILL) == 0);
        CHECK(freopen("/dev/null", "w", stdout) != NULL && freopen(log, "a", stderr) != NULL);
        execl(program, program, "--runtime-dir", run, "--root", root, "--prefix", prefix, (char *)NULL);
        _exit(127);
    }
    CHECK(pid > 0);
    /* As long as it lives it will be ready. */
    SbdpConnectOptions options;
    memset(&options, 0, sizeof options);
    options.struct_size = sizeof options;
    options.runtime_dir = run;
    for (;;) {
        SbdpClient *client = NULL;
        if (sbdp_client_connect(&options, &client, NULL) == SBDP_CODE_OK) {
            sbdp_client_free(&client);
            return pid;
        }
        if (waitpid(pid, NULL, WNOHANG) != 0) {
            fprintf(stderr, "%s has ended: see %s\n", program, log);
            abort();
        }
        struct timespec pause = {0, 20000000};
        nanosleep(&pause, NULL);
    }
}

static inline void end_daemon(pid_t pid, int signal) {
    CHECK(kill(pid, signal) == 0);
    CHECK(waitpid(pid, NULL, 0) == pid);
}

static inline double now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e6 + (double)now.tv_nsec * 1e-3;
}

static inline long resident_kib(void) {
    long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    CHECK(file != NULL && fscanf(file, "%*s %ld", &pages) == 1);
    fclose(file);
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

#endif
