/* Explicit integration of a generated right-hand side, of order 8 with two error estimates and dense output
   (Dormand and Prince's method as in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed.
   1993, II.5, II.6, II.10). `explicit_run.py` puts the tables in front: A, B, C, D, E3, E5. Being constants, their zeros
   cost nothing. */
#include <float.h>
#include <math.h>
#include <string.h>

typedef int (*function)(const double **, double **, long long *, double *, int);

/* Rows of a state; known to the compiler, which makes loops over few rows cheap. */
#ifndef ROWS
#error "ROWS is to be defined"
#endif
#define LARGER(a, b) ((a) > (b) ? (a) : (b))
#define UNROLLED _Pragma("GCC unroll 16")
enum { N = ROWS, STAGES = 12, ALL = 16, POWERS = 7 };
enum { DONE = 0, TOO_MANY = 1, TOO_SMALL = 2, NOT_FINITE = 3 };

/* Share of the step that would just do, and limits of its change. */
static const double SAFETY = 0.9, LEAST = 0.2, MOST = 10.0, ORDER = 8.0;

typedef struct {
    function rate;
    const double **arg;
    double **res;
    long long *iw;
    double *w;
} code;

static int evaluate(const code *f, double t, const double *x, double *out, long *count) {
    f->arg[0] = &t;
    f->arg[1] = x;
    f->res[0] = out;
    ++*count;
    return f->rate(f->arg, f->res, f->iw, f->w, 0);
}

/* y = x + h sum_j weights[j] k[j] */
static inline __attribute__((always_inline)) void combine(int terms, const double *weights, double (*restrict k)[N],
                                                          double h, const double *restrict x, double *restrict y) {
    for (int i = 0; i < N; ++i) {
        double sum = 0;
        UNROLLED
        for (int j = 0; j < terms; ++j)
            if (weights[j] != 0) sum += weights[j] * k[j][i];
        y[i] = (x ? x[i] : 0) + h * sum;
    }
}

/* Size of the error of a step from x to y over the tolerance; II.10, after equation 10.17. */
static double error_of(double (*k)[N], double h, const double *x, const double *y, double rtol, double atol) {
    double fifth = 0, third = 0, e5[N], e3[N];
    combine(STAGES + 1, E5, k, 1, 0, e5);
    combine(STAGES + 1, E3, k, 1, 0, e3);
    for (int i = 0; i < N; ++i) {
        const double scale = atol + rtol * LARGER(fabs(x[i]), fabs(y[i]));
        fifth += e5[i] / scale * (e5[i] / scale);
        third += e3[i] / scale * (e3[i] / scale);
    }
    if (fifth == 0 && third == 0) return 0;
    return fabs(h) * fifth / sqrt((fifth + 0.01 * third) * N);
}

static double norm(const double *x, const double *of, double rtol, double atol) {
    double sum = 0;
    for (int i = 0; i < N; ++i) {
        const double part = x[i] / (atol + rtol * fabs(of[i]));
        sum += part * part;
    }
    return sqrt(sum / N);
}

/* First step; II.4, algorithm of Gladwell, Shampine and Brankin. */
static double first_step(const code *f, double t, const double *x, double (*k)[N], double rtol, double atol,
                         double longest, long *count) {
    double there[N], slope[N];
    const double d0 = norm(x, x, rtol, atol), d1 = norm(k[0], x, rtol, atol), one = 1;
    double h = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h = fmin(h, longest);
    combine(1, &one, k, h, x, there);
    evaluate(f, t + h, there, slope, count);
    for (int i = 0; i < N; ++i) slope[i] -= k[0][i];
    const double most = fmax(d1, norm(slope, x, rtol, atol) / h);
    const double other = most <= 1e-15 ? fmax(1e-6, h * 1e-3) : pow(0.01 / most, 1 / ORDER);
    return fmin(fmin(100 * h, other), longest);
}

/* Seven columns of the interpolation of a step, after three more slopes; II.6. */
static void prepare(const code *f, double t, double h, const double *x, const double *y, double (*k)[N],
                    double (*dense)[N], long *count) {
    double there[N];
    UNROLLED
    for (int s = STAGES + 1; s < ALL; ++s) {
        combine(s, A[s], k, h, x, there);
        evaluate(f, t + C[s] * h, there, k[s], count);
    }
    for (int i = 0; i < N; ++i) {
        const double moved = y[i] - x[i];
        dense[0][i] = moved;
        dense[1][i] = h * k[0][i] - moved;
        dense[2][i] = 2 * moved - h * (k[STAGES][i] + k[0][i]);
    }
    UNROLLED
    for (int p = 3; p < POWERS; ++p) combine(ALL, D[p - 3], k, h, 0, dense[p]);
}

static void interpolate(double (*dense)[N], double part, const double *x, double *out) {
    for (int i = 0; i < N; ++i) {
        double sum = 0;
        UNROLLED
        for (int p = POWERS - 1; p >= 0; --p) sum = (sum + dense[p][i]) * (p % 2 ? 1 - part : part);
        out[i] = x[i] + sum;
    }
}

static int all_finite(const double *x) {
    for (int i = 0; i < N; ++i)
        if (!isfinite(x[i])) return 0;
    return 1;
}

/* Slopes of all stages of a step of h from x, and its end y; gives the error over the tolerance. */
static double attempt(const code *f, double t, double h, double then, const double *x, double *y, double (*k)[N],
                      double rtol, double atol, long *count) {
    double there[N];
    UNROLLED
    for (int s = 1; s < STAGES; ++s) {
        combine(s, A[s], k, h, x, there);
        evaluate(f, t + C[s] * h, there, k[s], count);
    }
    combine(STAGES, B, k, h, x, y);
    evaluate(f, then, y, k[STAGES], count);
    const double error = error_of(k, h, x, y, rtol, atol);
    return isfinite(error) ? error : INFINITY;
}

/* The states of all rows up to the end of a step; gives the first row beyond it. */
static int deliver(const code *f, double t, double h, double then, const double *x, const double *y, double (*k)[N],
                   int row, int rows, const double *times, double *states, long *count) {
    double dense[POWERS][N];
    int prepared = 0;
    for (; row < rows && times[row] <= then; ++row) {
        double *out = states + (long)row * N;
        if (times[row] == then) {
            memcpy(out, y, N * sizeof *y);
            continue;
        }
        if (!prepared) prepare(f, t, h, x, y, k, dense, count);
        prepared = 1;
        interpolate(dense, (times[row] - t) / h, x, out);
    }
    return row;
}

/* States at `times[1..rows-1]` from that at `times[0]`, the first of `states`.
   `most` steps are tried between two rows; `step` is the next step [s], zero for one to be found, and comes back;
   `steps` and `evaluations` are added to; `reached` is the last instant whose state is known. */
int march(function rate, const double **arg, double **res, long long *iw, double *w, const double *times,
          double *states, int rows, double rtol, double atol, double longest, long most, double *step, long *steps,
          long *evaluations, double *reached) {
    const code f = {rate, arg, res, iw, w};
    double k[ALL][N], x[N], y[N];
    const double end = times[rows - 1];
    double t = times[0], h = *step, limit = MOST;
    long tried = 0;
    int row = 1;
    memcpy(x, states, sizeof x);
    *reached = t;
    evaluate(&f, t, x, k[0], evaluations);
    if (!all_finite(k[0])) return NOT_FINITE;
    if (!(h > 0) && rows > 1) h = first_step(&f, t, x, k, rtol, atol, longest, evaluations);
    while (row < rows) {
        /* The last step ends at the last instant; one that would nearly reach it is halved. */
        const double left = end - t, wish = fmin(h, longest);
        const double now = wish >= left * (1 - 1e-10) ? left : fmin(wish, 0.5 * left);
        const double then = now == left ? end : t + now;
        if (!(now > 16 * DBL_EPSILON * fmax(fabs(t), fabs(end)))) return TOO_SMALL;
        if (++tried > most) return TOO_MANY;
        const double error = attempt(&f, t, now, then, x, y, k, rtol, atol, evaluations);
        const double factor = error == 0 ? MOST : fmax(LEAST, SAFETY * pow(error, -1 / ORDER));
        if (!(error < 1)) {
            h = now * fmin(1, factor);
            limit = 1; /* no growth right after a failure */
            continue;
        }
        const int next = deliver(&f, t, now, then, x, y, k, row, rows, times, states, evaluations);
        if (next > row) tried = 0;
        row = next;
        memcpy(k[0], k[STAGES], sizeof k[0]);
        memcpy(x, y, sizeof x);
        *reached = t = then;
        ++*steps;
        /* A step cut short by the end says nothing against the size tried before. */
        h = fmax(now * fmin(limit, factor), now < wish ? wish * fmin(1, factor) : 0);
        limit = MOST;
    }
    *step = h;
    return DONE;
}
