/* Evaluates generated code again and again, over given states in turn. */
#define _POSIX_C_SOURCE 200809L
#include <time.h>

typedef int (*function)(const double **, double **, long long *, double *, int);

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* Processor time [s] of `evaluations`; column k of input i begins at in[i] + k * rows[i]. `check` takes the sum
   of the first output, so that nothing can be left out. */
double own_loop(function f, int inputs, const double **in, const int *rows, int states, long evaluations,
                double *out, int out_rows, double **res, const double **arg, long long *iw, double *w,
                double *check) {
    double start = now(), sum = 0;
    int k = 0;
    for (long e = 0; e < evaluations; ++e) {
        for (int i = 0; i < inputs; ++i) arg[i] = in[i] + (long)k * rows[i];
        res[0] = out;
        f(arg, res, iw, w, 0);
        for (int j = 0; j < out_rows; ++j) sum += out[j];
        if (++k == states) k = 0;
    }
    *check = sum;
    return now() - start;
}
