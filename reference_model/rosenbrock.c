/* Integration of a generated right-hand side by a Rosenbrock method: implicit steps that solve linear equations
   only, with an error estimate and dense output (Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed.
   1996, IV.7). The tables come from outside; `rosenbrock_run.py` says what is in them.

   The right-hand side comes with the m unknowns w that its own equations are solved for (accelerations, forces
   that depend on them). Its derivative follows from those of x' = E(t, x, w) and 0 = R(t, x, w), of which none goes
   through a solution: J = E_x - E_w (R_w)^-1 R_x. */
#include <float.h>
#include <math.h>
#include <string.h>

typedef int (*function)(const double **, double **, long long *, double *, int);

/* Rows of a state and unknowns; known to the compiler, which makes loops over few rows cheap. */
#ifndef ROWS
#error "ROWS and UNKNOWNS are to be defined"
#endif
enum { N = ROWS, M = UNKNOWNS, WIDE = ROWS + 1 };
enum { DONE = 0, TOO_MANY = 1, TOO_SMALL = 2, NOT_FINITE = 3 };

/* Share of the step that would just do, and limits of its change. */
static const double SAFETY = 0.9, LEAST = 0.2, MOST = 6.0;

typedef struct {
    function run;
    const double **arg;
    double **res;
    long long *iw;
    double *w;
} code;

typedef struct {
    int stages, powers;
    double gamma, order;
    const double *a, *c, *instants, *slopes, *dense; /* stages x stages twice, stages twice, powers x stages */
} tables;

/* The derivative of [E; R] by [t; x; w] as generated: values by columns, their rows, where columns begin. */
typedef struct {
    const long long *rows, *starts;
    double *values;
} sparse;

typedef struct {
    double rate[N], unknown[M + 1], jacobian[N][WIDE], lu[N][N];
    int order[N];
    double own[M + 1][M + 1], solved[M + 1][WIDE]; /* R_w and R_w^-1 [R_t R_x] */
} local;

static void evaluate(const code *f, double t, const double *x, double *rate, double *unknown, long *count) {
    f->arg[0] = &t;
    f->arg[1] = x;
    f->res[0] = rate;
    f->res[1] = unknown;
    ++*count;
    f->run(f->arg, f->res, f->iw, f->w, 0);
}

/* Gaussian elimination with row exchanges of M x M equations with WIDE right-hand sides, which become the solution;
   0 where they are singular. */
static int solve_many(double (*a)[M + 1], double (*b)[WIDE]) {
    for (int k = 0; k < M; ++k) {
        int best = k;
        for (int i = k + 1; i < M; ++i)
            if (fabs(a[i][k]) > fabs(a[best][k])) best = i;
        if (!(fabs(a[best][k]) > 0)) return 0;
        if (best != k) {
            for (int j = k; j < M; ++j) { const double x = a[k][j]; a[k][j] = a[best][j]; a[best][j] = x; }
            for (int j = 0; j < WIDE; ++j) { const double x = b[k][j]; b[k][j] = b[best][j]; b[best][j] = x; }
        }
        for (int i = k + 1; i < M; ++i) {
            if (a[i][k] == 0) continue;
            const double share = a[i][k] / a[k][k];
            for (int j = k + 1; j < M; ++j) a[i][j] -= share * a[k][j];
            for (int j = 0; j < WIDE; ++j) b[i][j] -= share * b[k][j];
        }
    }
    for (int k = M - 1; k >= 0; --k) {
        for (int i = k + 1; i < M; ++i)
            if (a[k][i] != 0)
                for (int j = 0; j < WIDE; ++j) b[k][j] -= a[k][i] * b[i][j];
        for (int j = 0; j < WIDE; ++j) b[k][j] /= a[k][k];
    }
    return 1;
}

/* Columns of time and state of J; 0 where the unknowns cannot be solved for. */
static int differentiate(const code *g, const sparse *d, local *l, double t, const double *x) {
    g->arg[0] = &t;
    g->arg[1] = x;
    g->arg[2] = l->unknown;
    g->res[0] = d->values;
    g->run(g->arg, g->res, g->iw, g->w, 0);
    memset(l->jacobian, 0, sizeof l->jacobian);
    memset(l->own, 0, sizeof l->own);
    memset(l->solved, 0, sizeof l->solved);
    for (int c = 0; c < WIDE; ++c)
        for (long long k = d->starts[c]; k < d->starts[c + 1]; ++k)
            if (d->rows[k] < N) l->jacobian[d->rows[k]][c] = d->values[k];
            else l->solved[d->rows[k] - N][c] = d->values[k];
    for (int c = 0; c < M; ++c)
        for (long long k = d->starts[WIDE + c]; k < d->starts[WIDE + c + 1]; ++k)
            if (d->rows[k] >= N) l->own[d->rows[k] - N][c] = d->values[k];
    if (!solve_many(l->own, l->solved)) return 0;
    for (int c = 0; c < M; ++c)
        for (long long k = d->starts[WIDE + c]; k < d->starts[WIDE + c + 1]; ++k)
            if (d->rows[k] < N)
                for (int j = 0; j < WIDE; ++j) l->jacobian[d->rows[k]][j] -= d->values[k] * l->solved[c][j];
    return 1;
}

/* L and U of 1 / (gamma h) - J, by columns; 0 where it is singular. Rows of positions have few entries, so that most
   columns stay as they are while those are eliminated. */
static int factorise(local *l, double diagonal) {
    for (int i = 0; i < N; ++i)
        for (int j = 0; j < N; ++j) l->lu[j][i] = (i == j ? diagonal : 0) - l->jacobian[i][j + 1];
    for (int k = 0; k < N; ++k) {
        double *own = l->lu[k];
        int best = k;
        for (int i = k + 1; i < N; ++i)
            if (fabs(own[i]) > fabs(own[best])) best = i;
        l->order[k] = best;
        if (!(fabs(own[best]) > 0)) return 0;
        if (best != k)
            for (int j = 0; j < N; ++j) {
                const double x = l->lu[j][k];
                l->lu[j][k] = l->lu[j][best];
                l->lu[j][best] = x;
            }
        const double inverse = 1 / own[k];
        for (int i = k + 1; i < N; ++i) own[i] *= inverse;
        for (int j = k + 1; j < N; ++j) {
            const double share = l->lu[j][k];
            if (share != 0)
                for (int i = k + 1; i < N; ++i) l->lu[j][i] -= share * own[i];
        }
    }
    return 1;
}

static void solve(const local *l, double *b) {
    for (int k = 0; k < N; ++k) {
        const double x = b[l->order[k]];
        b[l->order[k]] = b[k];
        b[k] = x;
    }
    for (int k = 0; k < N; ++k)
        for (int i = k + 1; i < N; ++i) b[i] -= l->lu[k][i] * b[k];
    for (int k = N - 1; k >= 0; --k) {
        b[k] /= l->lu[k][k];
        for (int i = 0; i < k; ++i) b[i] -= l->lu[k][i] * b[k];
    }
}

/* y = x + sum over earlier stages of weights u */
static void combine(int terms, const double *weights, double (*u)[N], const double *x, double *y) {
    for (int i = 0; i < N; ++i) y[i] = x[i];
    for (int j = 0; j < terms; ++j)
        if (weights[j] != 0)
            for (int i = 0; i < N; ++i) y[i] += weights[j] * u[j][i];
}

static double norm(const double *x, const double *a, const double *b, double rtol, double atol) {
    double sum = 0;
    for (int i = 0; i < N; ++i) {
        const double part = x[i] / (atol + rtol * fmax(fabs(a[i]), fabs(b[i])));
        sum += part * part;
    }
    return sqrt(sum / N);
}

/* Stages of a step of h from x, and its end y, the last stage's place plus the last stage, which is the error too;
   gives the error over the tolerance. */
static double attempt(const code *f, const tables *m, local *l, double t, double h, const double *x, double *y,
                      double (*u)[N], double rtol, double atol, long *count) {
    if (!factorise(l, 1 / (m->gamma * h))) return INFINITY;
    for (int s = 0; s < m->stages; ++s) {
        const double *c = m->c + s * m->stages, pull = m->slopes[s] * h;
        combine(s, m->a + s * m->stages, u, x, y);
        if (s == 0) memcpy(u[0], l->rate, sizeof l->rate);
        else evaluate(f, t + m->instants[s] * h, y, u[s], 0, count);
        for (int j = 0; j < s; ++j) {
            const double share = c[j] / h;
            for (int i = 0; i < N; ++i) u[s][i] += share * u[j][i];
        }
        for (int i = 0; i < N; ++i) u[s][i] += pull * l->jacobian[i][0];
        solve(l, u[s]);
    }
    for (int i = 0; i < N; ++i) y[i] += u[m->stages - 1][i];
    const double error = norm(u[m->stages - 1], x, y, rtol, atol);
    return isfinite(error) ? error : INFINITY;
}

static void interpolate(const tables *m, double (*u)[N], double part, const double *x, const double *y, double *out) {
    double bow[N];
    memset(bow, 0, sizeof bow);
    for (int p = m->powers - 1; p >= 0; --p) {
        for (int i = 0; i < N; ++i) bow[i] *= part;
        combine(m->stages, m->dense + p * m->stages, u, bow, bow);
    }
    for (int i = 0; i < N; ++i) out[i] = (1 - part) * x[i] + part * (y[i] + (1 - part) * bow[i]);
}

static int all_finite(int n, const double *x) {
    for (int i = 0; i < n; ++i)
        if (!isfinite(x[i])) return 0;
    return 1;
}

/* First step: a hundredth of the state over its rate. */
static double first_step(const local *l, const double *x, double rtol, double atol, double longest) {
    const double d0 = norm(x, x, x, rtol, atol), d1 = norm(l->rate, x, x, rtol, atol);
    return fmin(d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1, longest);
}

/* States at `times[1..rows-1]` from that at `times[0]`, the first of `states`.
   `most` steps are tried between two rows; `step` is the next step [s], zero for one to be found, and comes back;
   `counts` are added to: steps, evaluations, derivatives, steps thrown away; `reached` is the last instant whose state
   is known. */
int rosenbrock(function rate, const double **arg, double **res, long long *iw, double *w, function derivative,
               const double **arg2, double **res2, long long *iw2, double *w2, const long long *jrows,
               const long long *jstarts, double *jvalues, int stages, int powers, double gamma, double order, const double *a, const double *c,
               const double *instants, const double *slopes, const double *dense, int rows, const double *times,
               double *states, double rtol, double atol, double longest, long most, double *step, long *counts,
               double *reached) {
    const code f = {rate, arg, res, iw, w}, g = {derivative, arg2, res2, iw2, w2};
    const tables m = {stages, powers, gamma, order, a, c, instants, slopes, dense};
    const sparse d = {jrows, jstarts, jvalues};
    static _Thread_local local l;
    double u[stages][N], x[N], y[N];
    const double end = times[rows - 1];
    double t = times[0], h = *step, limit = MOST, before = 0, kept = 1;
    long tried = 0;
    int row = 1, known = 0;
    memcpy(x, states, sizeof x);
    *reached = t;
    evaluate(&f, t, x, l.rate, l.unknown, counts + 1);
    if (!all_finite(N, l.rate)) return NOT_FINITE;
    if (!(h > 0) && rows > 1) h = first_step(&l, x, rtol, atol, longest);
    while (row < rows) {
        /* The last step ends at the last instant; one that would nearly reach it is halved. */
        const double left = end - t, wish = fmin(h, longest);
        const double now = wish >= left * (1 - 1e-10) ? left : fmin(wish, 0.5 * left);
        const double then = now == left ? end : t + now;
        if (!(now > 16 * DBL_EPSILON * fmax(fabs(t), fabs(end)))) return TOO_SMALL;
        if (++tried > most) return TOO_MANY;
        if (!known && ++counts[2] && !differentiate(&g, &d, &l, t, x)) return NOT_FINITE;
        known = 1;
        const double error = attempt(&f, &m, &l, t, now, x, y, u, rtol, atol, counts + 1);
        double factor = error == 0 ? MOST : fmax(LEAST, SAFETY * pow(error, -1 / m.order));
        if (!(error < 1)) {
            h = now * fmin(1, factor);
            limit = 1; /* no growth right after a failure */
            ++counts[3];
            continue;
        }
        /* Gustafsson's prediction: errors that have grown from step to step go on growing; IV.8. */
        if (before > 0 && error > 0)
            factor = fmin(factor, fmax(LEAST, SAFETY * now / before * pow(error * error / kept, -1 / m.order)));
        before = now;
        kept = fmax(error, 1e-2);
        for (; row < rows && times[row] <= then; ++row, tried = 0) {
            double *out = states + (long)row * N;
            if (times[row] == then) memcpy(out, y, sizeof y);
            else interpolate(&m, u, (times[row] - t) / now, x, y, out);
        }
        memcpy(x, y, sizeof x);
        *reached = t = then;
        ++counts[0];
        known = 0;
        if (row < rows) {
            evaluate(&f, t, x, l.rate, l.unknown, counts + 1);
            if (!all_finite(N, l.rate)) return NOT_FINITE;
        }
        /* A step cut short by the end says nothing against the size tried before. */
        h = fmax(now * fmin(limit, factor), now < wish ? wish * fmin(1, factor) : 0);
        limit = MOST;
    }
    *step = h;
    return DONE;
}
