/* mj_forward again and again, over given states in turn. */
#define _POSIX_C_SOURCE 200809L
#include <mujoco/mujoco.h>
#include <string.h>
#include <time.h>

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* Processor time [s] of `evaluations`, or -1 when the file cannot be loaded. `check` takes the sum of qacc. */
double mujoco_loop(const char *path, const double *qpos, const double *qvel, const double *force, int states,
                   long evaluations, double *check) {
    char error[500];
    mjModel *m = mj_loadXML(path, 0, error, sizeof error);
    if (!m) return -1;
    mjData *d = mj_makeData(m);
    double sum = 0, used = 0;
    for (int warm = 1; warm >= 0; --warm) {
        int k = 0;
        sum = 0;
        double start = now();
        for (long e = 0; e < (warm ? states : evaluations); ++e) {
            memcpy(d->qpos, qpos + (long)k * m->nq, m->nq * sizeof(double));
            memcpy(d->qvel, qvel + (long)k * m->nv, m->nv * sizeof(double));
            memcpy(d->qfrc_applied, force + (long)k * m->nv, m->nv * sizeof(double));
            mj_forward(m, d);
            for (int j = 0; j < m->nv; ++j) sum += d->qacc[j];
            if (++k == states) k = 0;
        }
        used = now() - start;
    }
    *check = sum;
    mj_deleteData(d);
    mj_deleteModel(m);
    return used;
}
