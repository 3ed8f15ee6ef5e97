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

/* Rows of a state, those of positions among them, which come first, and unknowns; known to the compiler, which makes
   loops over few rows cheap. Lengths are rounded up to whole vector registers, the rest of them being zero. */
#if !defined ROWS || !defined POSITIONS || !defined UNKNOWNS
#error "ROWS, POSITIONS and UNKNOWNS are to be defined"
#endif
#define PADDED(n) (((n) + 3) / 4 * 4)
enum { N = ROWS, P = POSITIONS, R = ROWS - POSITIONS, M = UNKNOWNS };
enum { NP = PADDED(N), PP = PADDED(P), RP = PADDED(R), MP = PADDED(M), WIDE = PADDED(N + 1) };
#define LARGER(a, b) ((a) > (b) ? (a) : (b))
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

/* J apart by positions p and the other rows r, each block by columns, and what solves 1 / (gamma h) - J:
   A = 1 / (gamma h) - J_pp, `own` = A^-1, `through` = A^-1 J_pr, `rest` = (1 / (gamma h) - J_rr - J_rp A^-1 J_pr)^-1.
   Each has a column more than it needs, for robots without one of the two. */
typedef struct {
    double rate[NP], unknown[MP + 4], by_time[NP];
    double pp[P + 1][PP + 4], pr[R + 1][PP + 4], rp[P + 1][RP + 4], rr[R + 1][RP + 4];
    double own[P + 1][PP + 4], through[R + 1][PP + 4], rest[R + 1][RP + 4];
    double jacobian[N][WIDE], bound[M + 1][MP + 4], solved[M + 1][WIDE]; /* J; R_w and R_w^-1 [R_t R_x] */
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
static int solve_many(double (*a)[MP + 4], double (*b)[WIDE]) {
    for (int k = 0; k < M; ++k) {
        double *restrict own = a[k], *restrict right = b[k];
        int best = k;
        for (int i = k + 1; i < M; ++i)
            if (fabs(a[i][k]) > fabs(a[best][k])) best = i;
        if (!(fabs(a[best][k]) > 0)) return 0;
        if (best != k) {
            for (int j = 0; j < MP; ++j) { const double x = a[k][j]; a[k][j] = a[best][j]; a[best][j] = x; }
            for (int j = 0; j < WIDE; ++j) { const double x = b[k][j]; b[k][j] = b[best][j]; b[best][j] = x; }
        }
        const double inverse = 1 / own[k];
        for (int j = 0; j < MP; ++j) own[j] *= inverse;
        for (int j = 0; j < WIDE; ++j) right[j] *= inverse;
        for (int i = k + 1; i < M; ++i) {
            double *restrict other = a[i], *restrict change = b[i];
            const double share = other[k];
            if (share == 0) continue;
            for (int j = 0; j < MP; ++j) other[j] -= share * own[j];
            for (int j = 0; j < WIDE; ++j) change[j] -= share * right[j];
        }
    }
    for (int k = M - 1; k >= 0; --k) {
        double *restrict own = b[k];
        for (int i = k + 1; i < M; ++i)
            if (a[k][i] != 0)
                for (int j = 0; j < WIDE; ++j) own[j] -= a[k][i] * b[i][j];
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
    memset(l->bound, 0, sizeof l->bound);
    memset(l->solved, 0, sizeof l->solved);
    for (int c = 0; c < N + 1; ++c)
        for (long long k = d->starts[c]; k < d->starts[c + 1]; ++k)
            if (d->rows[k] < N) l->jacobian[d->rows[k]][c] = d->values[k];
            else l->solved[d->rows[k] - N][c] = d->values[k];
    for (int c = 0; c < M; ++c)
        for (long long k = d->starts[N + 1 + c]; k < d->starts[N + 2 + c]; ++k)
            if (d->rows[k] >= N) l->bound[d->rows[k] - N][c] = d->values[k];
    if (!solve_many(l->bound, l->solved)) return 0;
    for (int c = 0; c < M; ++c)
        for (long long k = d->starts[N + 1 + c]; k < d->starts[N + 2 + c]; ++k)
            if (d->rows[k] < N) {
                double *restrict row = l->jacobian[d->rows[k]];
                const double share = d->values[k], *restrict solved = l->solved[c];
                for (int j = 0; j < WIDE; ++j) row[j] -= share * solved[j];
            }
    for (int i = 0; i < N; ++i) l->by_time[i] = l->jacobian[i][0];
    for (int i = 0; i < P; ++i) {
        for (int j = 0; j < P; ++j) l->pp[j][i] = l->jacobian[i][1 + j];
        for (int j = 0; j < R; ++j) l->pr[j][i] = l->jacobian[i][1 + P + j];
    }
    for (int i = 0; i < R; ++i) {
        for (int j = 0; j < P; ++j) l->rp[j][i] = l->jacobian[P + i][1 + j];
        for (int j = 0; j < R; ++j) l->rr[j][i] = l->jacobian[P + i][1 + P + j];
    }
    return 1;
}

/* The n columns of a matrix, `wide` numbers from one to the next, become those of its inverse; 0 where it is singular.
   Columns are combined, and exchanged where `exchanging`, which leaves the inverse's rows in another order. */
static inline __attribute__((always_inline)) int invert(int n, int wide, int length, int exchanging, double *a) {
    int order[n + 1];
    for (int k = 0; k < n; ++k) {
        double *restrict own = a + k * wide;
        int best = k;
        if (exchanging)
            for (int i = k + 1; i < n; ++i)
                if (fabs(a[i * wide + k]) > fabs(a[best * wide + k])) best = i;
        order[k] = best;
        if (!(fabs(a[best * wide + k]) > 0)) return 0;
        if (best != k)
            for (int j = 0; j < length; ++j) {
                const double x = own[j];
                own[j] = a[best * wide + j];
                a[best * wide + j] = x;
            }
        const double inverse = 1 / own[k];
        own[k] = 1;
        for (int j = 0; j < length; ++j) own[j] *= inverse;
        for (int i = 0; i < n; ++i) {
            double *restrict other = a + i * wide;
            const double share = other[k];
            if (i == k || share == 0) continue;
            other[k] = 0;
            for (int j = 0; j < length; ++j) other[j] -= share * own[j];
        }
    }
    for (int k = n - 1; k >= 0; --k)
        if (order[k] != k)
            for (int i = 0; i < n; ++i) {
                double *column = a + i * wide;
                const double x = column[k];
                column[k] = column[order[k]];
                column[order[k]] = x;
            }
    return 1;
}

/* Makes ready to solve with 1 / (gamma h) - J; 0 where it is singular. Positions are eliminated first, most of whose
   rows have an entry or two; what is left is half as wide. J_pp holds what a quaternion's rates have of itself, which
   is skew: what is left of the diagonal is never smaller than it was, and nothing needs to be exchanged there. As a
   step solves six or eight times, both parts are inverted: products have no divisions that wait for one another. */
static int factorise(local *l, double diagonal) {
    for (int j = 0; j < P; ++j) {
        for (int i = 0; i < PP; ++i) l->own[j][i] = -l->pp[j][i];
        l->own[j][j] += diagonal;
    }
    if (!invert(P, PP + 4, PP, 0, l->own[0])) return 0;
    for (int j = 0; j < R; ++j) {
        double *restrict through = l->through[j], *restrict rest = l->rest[j];
        memset(through, 0, PP * sizeof *through);
        for (int k = 0; k < P; ++k)
            if (l->pr[j][k] != 0)
                for (int i = 0; i < PP; ++i) through[i] += l->pr[j][k] * l->own[k][i];
        for (int i = 0; i < RP; ++i) rest[i] = -l->rr[j][i];
        rest[j] += diagonal;
        for (int k = 0; k < P; ++k)
            if (through[k] != 0)
                for (int i = 0; i < RP; ++i) rest[i] -= through[k] * l->rp[k][i];
    }
    return invert(R, RP + 4, RP, 1, l->rest[0]);
}

/* y += A x with n columns, `wide` numbers from one to the next; four at a time, since y waits for itself. */
static inline __attribute__((always_inline)) void add_product(int n, int wide, int length, const double *a,
                                                              const double *x, double *y) {
    int k = 0;
    for (; k + 3 < n; k += 4, a += 4 * wide)
        for (int i = 0; i < length; ++i)
            y[i] += (x[k] * a[i] + x[k + 1] * a[wide + i]) + (x[k + 2] * a[2 * wide + i] + x[k + 3] * a[3 * wide + i]);
    for (; k < n; ++k, a += wide)
        for (int i = 0; i < length; ++i) y[i] += x[k] * a[i];
}

static void solve(const local *l, double *b) {
    double positions[PP + 4], rest[RP + 4], right[RP + 4];
    memset(positions, 0, sizeof positions);
    memset(rest, 0, sizeof rest);
    memset(right, 0, sizeof right);
    for (int i = 0; i < R; ++i) right[i] = b[P + i];
    add_product(P, PP + 4, PP, l->own[0], b, positions);
    add_product(P, RP + 4, RP, l->rp[0], positions, right);
    add_product(R, RP + 4, RP, l->rest[0], right, rest);
    add_product(R, PP + 4, PP, l->through[0], rest, positions);
    memcpy(b, positions, P * sizeof *b);
    memcpy(b + P, rest, R * sizeof *b);
}

/* y = x + sum over earlier stages of weights u */
static void combine(int terms, const double *weights, double (*u)[NP], const double *x, double *y) {
    for (int i = 0; i < NP; ++i) y[i] = x[i];
    for (int j = 0; j < terms; ++j)
        if (weights[j] != 0)
            for (int i = 0; i < NP; ++i) y[i] += weights[j] * u[j][i];
}

static double norm(const double *x, const double *a, const double *b, double rtol, double atol) {
    double sum = 0;
    for (int i = 0; i < N; ++i) {
        const double part = x[i] / (atol + rtol * LARGER(fabs(a[i]), fabs(b[i])));
        sum += part * part;
    }
    return sqrt(sum / N);
}

/* Stages of a step of h from x, and its end y, the last stage's place plus the last stage, which is the error too;
   gives the error over the tolerance. */
static double attempt(const code *f, const tables *m, local *l, double t, double h, const double *x, double *y,
                      double (*u)[NP], double rtol, double atol, long *count) {
    if (!factorise(l, 1 / (m->gamma * h))) return INFINITY;
    for (int s = 0; s < m->stages; ++s) {
        const double *c = m->c + s * m->stages, pull = m->slopes[s] * h;
        combine(s, m->a + s * m->stages, u, x, y);
        if (s == 0) memcpy(u[0], l->rate, sizeof u[0]);
        else evaluate(f, t + m->instants[s] * h, y, u[s], 0, count);
        for (int j = 0; j < s; ++j) {
            const double share = c[j] / h;
            for (int i = 0; i < NP; ++i) u[s][i] += share * u[j][i];
        }
        for (int i = 0; i < NP; ++i) u[s][i] += pull * l->by_time[i];
        solve(l, u[s]);
    }
    for (int i = 0; i < N; ++i) y[i] += u[m->stages - 1][i];
    const double error = norm(u[m->stages - 1], x, y, rtol, atol);
    return isfinite(error) ? error : INFINITY;
}

static void interpolate(const tables *m, double (*u)[NP], double part, const double *x, const double *y, double *out) {
    double bow[NP];
    memset(bow, 0, sizeof bow);
    for (int p = m->powers - 1; p >= 0; --p) {
        for (int i = 0; i < NP; ++i) bow[i] *= part;
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

/* Numbers of room that a run needs. */
long room_for_rosenbrock(void) { return sizeof(local) / sizeof(double); }

/* States at `times[1..rows-1]` from that at `times[0]`, the first of `states`.
   `most` steps are tried between two rows; `step` is the next step [s], zero for one to be found, and comes back;
   `counts` are added to: steps, evaluations, derivatives, steps thrown away; `reached` is the last instant whose state
   is known; `room` holds what `room_for_rosenbrock` says, zeros at first. */
int rosenbrock(function rate, const double **arg, double **res, long long *iw, double *w, function derivative,
               const double **arg2, double **res2, long long *iw2, double *w2, const long long *jrows,
               const long long *jstarts, double *jvalues, int stages, int powers, double gamma, double order, const double *a, const double *c,
               const double *instants, const double *slopes, const double *dense, int rows, const double *times,
               double *states, double rtol, double atol, double longest, long most, double *step, long *counts,
               double *reached, void *room) {
    const code f = {rate, arg, res, iw, w}, g = {derivative, arg2, res2, iw2, w2};
    const tables m = {stages, powers, gamma, order, a, c, instants, slopes, dense};
    const sparse d = {jrows, jstarts, jvalues};
    local *l = room;
    double u[stages][NP], x[NP], y[NP];
    const double end = times[rows - 1];
    double t = times[0], h = *step, limit = MOST, before = 0, kept = 1;
    long tried = 0;
    int row = 1, known = 0;
    memset(u, 0, sizeof u);
    memset(x, 0, sizeof x);
    memset(y, 0, sizeof y);
    memcpy(x, states, N * sizeof *x);
    *reached = t;
    evaluate(&f, t, x, l->rate, l->unknown, counts + 1);
    if (!all_finite(N, l->rate)) return NOT_FINITE;
    if (!(h > 0) && rows > 1) h = first_step(l, x, rtol, atol, longest);
    while (row < rows) {
        /* The last step ends at the last instant; one that would nearly reach it is halved. */
        const double left = end - t, wish = fmin(h, longest);
        const double now = wish >= left * (1 - 1e-10) ? left : fmin(wish, 0.5 * left);
        const double then = now == left ? end : t + now;
        if (!(now > 16 * DBL_EPSILON * fmax(fabs(t), fabs(end)))) return TOO_SMALL;
        if (++tried > most) return TOO_MANY;
        if (!known && ++counts[2] && !differentiate(&g, &d, l, t, x)) return NOT_FINITE;
        known = 1;
        const double error = attempt(&f, &m, l, t, now, x, y, u, rtol, atol, counts + 1);
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
            if (times[row] == then) memcpy(out, y, N * sizeof *y);
            else interpolate(&m, u, (times[row] - t) / now, x, y, out);
        }
        memcpy(x, y, sizeof x);
        *reached = t = then;
        ++counts[0];
        known = 0;
        if (row < rows) {
            evaluate(&f, t, x, l->rate, l->unknown, counts + 1);
            if (!all_finite(N, l->rate)) return NOT_FINITE;
        }
        /* A step cut short by the end says nothing against the size tried before. */
        h = fmax(now * fmin(limit, factor), now < wish ? wish * fmin(1, factor) : 0);
        limit = MOST;
    }
    *step = h;
    return DONE;
}
