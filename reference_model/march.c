/* Explicit integration of a generated right-hand side, of order 8 with two error estimates and dense output
   (Dormand and Prince's method as in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed.
   1993, II.5, II.6, II.10). The tables come from outside; `explicit_run.py` says what is in them. */
#include <float.h>
#include <math.h>
#include <string.h>

typedef int (*function)(const double **, double **, long long *, double *, int);

/* Rows of a state; known to the compiler where it is told, which makes loops over few rows cheap. */
#ifdef ROWS
#define COUNT(n) ((void)(n), ROWS)
#else
#define COUNT(n) (n)
#endif

enum { STAGES = 12, ALL = 16, POWERS = 7 };
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

typedef struct {
    const double *a, *c, *b, *e3, *e5, *d; /* ALL x ALL, ALL, STAGES, STAGES + 1, STAGES + 1, (POWERS - 3) x ALL */
} tables;

static int evaluate(const code *f, double t, const double *x, double *out, long *count) {
    f->arg[0] = &t;
    f->arg[1] = x;
    f->res[0] = out;
    ++*count;
    return f->rate(f->arg, f->res, f->iw, f->w, 0);
}

/* y = x + h sum_j weights[j] k[j] */
static void combine(int n, int terms, const double *weights, const double *k, double h, const double *x, double *y) {
    for (int i = 0; i < COUNT(n); ++i) y[i] = 0;
    for (int j = 0; j < terms; ++j) {
        const double weight = weights[j], *slope = k + (long)j * n;
        if (weight != 0)
            for (int i = 0; i < COUNT(n); ++i) y[i] += weight * slope[i];
    }
    for (int i = 0; i < COUNT(n); ++i) y[i] = (x ? x[i] : 0) + h * y[i];
}

/* Size of the error of a step from x to y over the tolerance; II.10, after equation 10.17. */
static double error_of(int n, const tables *m, const double *k, double h, const double *x, const double *y,
                       double rtol, double atol, double *spare) {
    double fifth = 0, third = 0, *e5 = spare, *e3 = spare + n;
    combine(n, STAGES + 1, m->e5, k, 1, 0, e5);
    combine(n, STAGES + 1, m->e3, k, 1, 0, e3);
    for (int i = 0; i < COUNT(n); ++i) {
        const double scale = atol + rtol * fmax(fabs(x[i]), fabs(y[i]));
        fifth += e5[i] / scale * (e5[i] / scale);
        third += e3[i] / scale * (e3[i] / scale);
    }
    if (fifth == 0 && third == 0) return 0;
    return fabs(h) * fifth / sqrt((fifth + 0.01 * third) * n);
}

static double norm(int n, const double *x, const double *of, double rtol, double atol) {
    double sum = 0;
    for (int i = 0; i < COUNT(n); ++i) {
        const double part = x[i] / (atol + rtol * fabs(of[i]));
        sum += part * part;
    }
    return sqrt(sum / n);
}

/* First step; II.4, algorithm of Gladwell, Shampine and Brankin. */
static double first_step(const code *f, int n, double t, const double *x, const double *k, double rtol, double atol,
                         double longest, double *spare, long *count) {
    const double d0 = norm(n, x, x, rtol, atol), d1 = norm(n, k, x, rtol, atol);
    double h = d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1;
    h = fmin(h, longest);
    combine(n, 1, &(double){1}, k, h, x, spare);
    evaluate(f, t + h, spare, spare + n, count);
    for (int i = 0; i < COUNT(n); ++i) spare[n + i] -= k[i];
    const double most = fmax(d1, norm(n, spare + n, x, rtol, atol) / h);
    const double other = most <= 1e-15 ? fmax(1e-6, h * 1e-3) : pow(0.01 / most, 1 / ORDER);
    return fmin(fmin(100 * h, other), longest);
}

/* Seven columns of the interpolation of a step, after three more slopes; II.6. */
static void prepare(const code *f, const tables *m, int n, double t, double h, const double *x, const double *y,
                    double *k, double *dense, double *spare, long *count) {
    for (int s = STAGES + 1; s < ALL; ++s) {
        combine(n, s, m->a + s * ALL, k, h, x, spare);
        evaluate(f, t + m->c[s] * h, spare, k + (long)s * n, count);
    }
    const double *first = k, *last = k + (long)STAGES * n;
    for (int i = 0; i < COUNT(n); ++i) {
        const double moved = y[i] - x[i];
        dense[i] = moved;
        dense[n + i] = h * first[i] - moved;
        dense[2 * n + i] = 2 * moved - h * (last[i] + first[i]);
    }
    for (int p = 3; p < POWERS; ++p) combine(n, ALL, m->d + (p - 3) * ALL, k, h, 0, dense + (long)p * n);
}

static void interpolate(int n, const double *dense, double part, const double *x, double *out) {
    for (int i = 0; i < COUNT(n); ++i) {
        double sum = 0;
        for (int p = POWERS - 1; p >= 0; --p) sum = (sum + dense[(long)p * n + i]) * (p % 2 ? 1 - part : part);
        out[i] = x[i] + sum;
    }
}

static int all_finite(int n, const double *x) {
    for (int i = 0; i < COUNT(n); ++i)
        if (!isfinite(x[i])) return 0;
    return 1;
}

/* Slopes of all stages of a step of h from x, and its end y; gives the error over the tolerance. */
static double attempt(const code *f, const tables *m, int n, double t, double h, double then, const double *x,
                      double *y, double *k, double rtol, double atol, double *spare, long *count) {
    for (int s = 1; s < STAGES; ++s) {
        combine(n, s, m->a + s * ALL, k, h, x, spare);
        evaluate(f, t + m->c[s] * h, spare, k + (long)s * n, count);
    }
    combine(n, STAGES, m->b, k, h, x, y);
    evaluate(f, then, y, k + (long)STAGES * n, count);
    const double error = error_of(n, m, k, h, x, y, rtol, atol, spare);
    return isfinite(error) ? error : INFINITY;
}

/* The states of all rows up to the end of a step; gives the first row beyond it. */
static int deliver(const code *f, const tables *m, int n, double t, double h, double then, const double *x,
                   const double *y, double *k, double *dense, double *spare, int row, int rows, const double *times,
                   double *states, long *count) {
    int prepared = 0;
    for (; row < rows && times[row] <= then; ++row) {
        double *out = states + (long)row * n;
        if (times[row] == then) {
            memcpy(out, y, n * sizeof *y);
            continue;
        }
        if (!prepared) prepare(f, m, n, t, h, x, y, k, dense, spare, count);
        prepared = 1;
        interpolate(n, dense, (times[row] - t) / h, x, out);
    }
    return row;
}

/* States at `times[1..rows-1]` from that at `times[0]`, the first of `states`.
   `most` steps are tried between two rows; `work` holds (ALL + POWERS + 4) n numbers; `step` is the next step [s],
   zero for one to be found, and comes back; `steps` and `evaluations` are added to; `reached` is the last instant
   whose state is known. */
int march(function rate, const double **arg, double **res, long long *iw, double *w, int n, const double *a,
          const double *c, const double *b, const double *e3, const double *e5, const double *d, int rows,
          const double *times, double *states, double rtol, double atol, double longest, long most, double *work,
          double *step, long *steps, long *evaluations, double *reached) {
    const code f = {rate, arg, res, iw, w};
    const tables m = {a, c, b, e3, e5, d};
    double *k = work, *dense = k + (long)ALL * n, *x = dense + (long)POWERS * n, *y = x + n, *spare = y + n;
    const double end = times[rows - 1];
    double t = times[0], h = *step, limit = MOST;
    long tried = 0;
    int row = 1;
    memcpy(x, states, n * sizeof *x);
    *reached = t;
    evaluate(&f, t, x, k, evaluations);
    if (!all_finite(n, k)) return NOT_FINITE;
    if (!(h > 0) && rows > 1) h = first_step(&f, n, t, x, k, rtol, atol, longest, spare, evaluations);
    while (row < rows) {
        /* The last step ends at the last instant; one that would nearly reach it is halved. */
        const double left = end - t, wish = fmin(h, longest);
        const double now = wish >= left * (1 - 1e-10) ? left : fmin(wish, 0.5 * left);
        const double then = now == left ? end : t + now;
        if (!(now > 16 * DBL_EPSILON * fmax(fabs(t), fabs(end)))) return TOO_SMALL;
        if (++tried > most) return TOO_MANY;
        const double error = attempt(&f, &m, n, t, now, then, x, y, k, rtol, atol, spare, evaluations);
        const double factor = error == 0 ? MOST : fmax(LEAST, SAFETY * pow(error, -1 / ORDER));
        if (!(error < 1)) {
            h = now * fmin(1, factor);
            limit = 1; /* no growth right after a failure */
            continue;
        }
        const int next = deliver(&f, &m, n, t, now, then, x, y, k, dense, spare, row, rows, times, states, evaluations);
        if (next > row) tried = 0;
        row = next;
        memcpy(k, k + (long)STAGES * n, n * sizeof *k);
        memcpy(x, y, n * sizeof *x);
        *reached = t = then;
        ++*steps;
        /* A step cut short by the end says nothing against the size tried before. */
        h = fmax(now * fmin(limit, factor), now < wish ? wish * fmin(1, factor) : 0);
        limit = MOST;
    }
    *step = h;
    return DONE;
}
