/* Newmark's method for several systems of a few coordinates along one motion, and their forces on other rows.
   `newmark.py` has the equations, and puts P, the number of coordinates, in front. */

typedef const double *const *restrict arrays;

/* Solve a x = b for several right-hand sides, by elimination with row pivoting; a and b are overwritten. */
static void solve(long columns, double a[P][P], double b[P][columns]) {
    for (int k = 0; k < P; ++k) {
        int pivot = k;
        for (int i = k + 1; i < P; ++i)
            if (__builtin_fabs(a[i][k]) > __builtin_fabs(a[pivot][k])) pivot = i;
        for (int j = 0; j < P && pivot != k; ++j) {
            const double kept = a[k][j];
            a[k][j] = a[pivot][j];
            a[pivot][j] = kept;
        }
        for (long c = 0; c < columns && pivot != k; ++c) {
            const double kept = b[k][c];
            b[k][c] = b[pivot][c];
            b[pivot][c] = kept;
        }
        for (int i = k + 1; i < P; ++i) {
            const double share = a[i][k] / a[k][k];
            for (int j = k + 1; j < P; ++j) a[i][j] -= share * a[k][j];
            for (long c = 0; c < columns; ++c) b[i][c] -= share * b[k][c];
        }
    }
    for (int k = P - 1; k >= 0; --k)
        for (long c = 0; c < columns; ++c) {
            for (int j = k + 1; j < P; ++j) b[k][c] -= a[k][j] * b[j][c];
            b[k][c] /= a[k][k];
        }
}

/* b = f - k x - d v with the force f on the first column. */
static void forced(long columns, const double *f, double k[P][P], double d[P][P], double x[P][columns],
                   double v[P][columns], double b[P][columns]) {
    for (int i = 0; i < P; ++i)
        for (long c = 0; c < columns; ++c) {
            double sum = c ? 0 : f[i];
            for (int j = 0; j < P; ++j) sum -= k[i][j] * x[j][c] + d[i][j] * v[j][c];
            b[i][c] = sum;
        }
}

/* instants N, systems V, other rows n, columns C; mass, rate, place: (N, P + n, P) of each system; force: (N, P) of
   each; springs: (V, 2, P, P); implicit: (V, P, P); start: (2, V, P, C); out: (N, n, V, C). */
void pushed(long instants, long systems, long others, long columns, double h, arrays mass, arrays rate, arrays place,
            arrays force, const double *restrict springs, const double *restrict implicit,
            const double *restrict start, double *restrict out) {
    const long size = (P + others) * P;
    for (long v = 0; v < systems; ++v) {
        const double(*spring)[P][P] = (const double(*)[P][P])(springs + 2 * v * P * P);
        double weight[P][P], x[P][columns], y[P][columns], a[P][columns], k[P][P], d[P][P], s[P][P];
        for (int i = 0; i < P; ++i) {
            for (int j = 0; j < P; ++j) weight[i][j] = h * h * implicit[(v * P + i) * P + j];
            for (long c = 0; c < columns; ++c) {
                x[i][c] = start[(v * P + i) * columns + c];
                y[i][c] = start[((systems + v) * P + i) * columns + c];
            }
        }
        for (long t = 0; t < instants; ++t) {
            const double *m = mass[v] + t * size, *r = rate[v] + t * size, *g = place[v] + t * size;
            for (int i = 0; i < P; ++i)
                for (int j = 0; j < P; ++j) {
                    k[i][j] = g[i * P + j] + spring[0][i][j];
                    d[i][j] = r[i * P + j] + spring[1][i][j];
                    s[i][j] = m[i * P + j];
                }
            if (!t) { /* from the given state to the predicted one of the first instant */
                forced(columns, force[v], k, d, x, y, a);
                solve(columns, s, a);
                for (int i = 0; i < P; ++i)
                    for (long c = 0; c < columns; ++c) {
                        for (int j = 0; j < P; ++j) x[i][c] -= weight[i][j] * a[j][c];
                        y[i][c] -= h / 2 * a[i][c];
                    }
            }
            for (int i = 0; i < P; ++i)
                for (int j = 0; j < P; ++j) {
                    double sum = m[i * P + j] + h / 2 * d[i][j];
                    for (int l = 0; l < P; ++l) sum += k[i][l] * weight[l][j];
                    s[i][j] = sum;
                }
            forced(columns, force[v] + t * P, k, d, x, y, a);
            solve(columns, s, a);
            m += P * P, r += P * P, g += P * P;
            for (long o = 0; o < others; ++o) {
                double *to = out + ((t * others + o) * systems + v) * columns;
                for (long c = 0; c < columns; ++c) to[c] = 0;
                for (int j = 0; j < P; ++j) {
                    double by_a = m[o * P + j] + h / 2 * r[o * P + j];
                    for (int l = 0; l < P; ++l) by_a += g[o * P + l] * weight[l][j];
                    for (long c = 0; c < columns; ++c)
                        to[c] += by_a * a[j][c] + r[o * P + j] * y[j][c] + g[o * P + j] * x[j][c];
                }
            }
            for (int i = 0; i < P; ++i)
                for (long c = 0; c < columns; ++c) {
                    x[i][c] += h * (y[i][c] + h * a[i][c]);
                    y[i][c] += h * a[i][c];
                }
        }
    }
}
