/* Kalman filter and smoother of one joint's deviation from a reference motion.

   State: x = [q, v, l_1 .. l_L]: deviation of the joint's position and rate, and latent forces, each an
   Ornstein-Uhlenbeck process of time constant tau_i and stationary variance var_i. Over a step of length h,
   by the implicit midpoint rule (A-stable, second order):

     v' = v + h (b (f + sum l_i) - k (q + q')/2 - d (v + v')/2),   q' = q + h (v + v')/2,   l_i' = phi_i l_i

   b is one over the joint's inertia, k and d its stiffness and damping over its inertia, f the force at the
   middle of the step with white noise of variance Q. Row j of a sample measures x[sel[j]] with variance
   R[j]; a negative one marks a row without a measurement. Rows are taken one after the other. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST 8 /* states */

typedef struct {
  double qq, qv, vq, vv, bq, bv; /* transition of [q; v], and what a force does to it */
} Step;

static Step step_of(double h, double b, double k, double d) {
  double c = h * (0.25 * h * k + 0.5 * d), under = 1.0 / (1.0 + c);
  Step s;
  s.vq = -h * k * under;
  s.vv = (1.0 - c) * under;
  s.bv = h * b * under;
  s.qq = 1.0 + 0.5 * h * s.vq;
  s.qv = 0.5 * h * (1.0 + s.vv);
  s.bq = 0.5 * h * s.bv;
  return s;
}

static void transition(long ns, const Step *s, const double *phi, double A[MOST][MOST]) {
  memset(A, 0, sizeof(double) * MOST * MOST);
  A[0][0] = s->qq;
  A[0][1] = s->qv;
  A[1][0] = s->vq;
  A[1][1] = s->vv;
  for (long i = 2; i < ns; i++) {
    A[0][i] = s->bq;
    A[1][i] = s->bv;
    A[i][i] = phi[i - 2];
  }
}

static void decay(long L, double h, const double *tau, double *phi) {
  for (long i = 0; i < L; i++) phi[i] = exp(-h / tau[i]);
}

/* Gains K (N, m, ns) and innovation variances S (N, m); rows without a measurement get K = 0 and S = 0.
   P: predicted covariances (N, ns, ns), or NULL. */
void gains(long N, long L, long m, const int *sel, const double *h, const double *b, const double *k,
           const double *d, const double *Q, const double *tau, const double *var, const double *R,
           const double *P0, double *K, double *S, double *P) {
  long ns = 2 + L;
  double C[MOST][MOST] = {{0}}, A[MOST][MOST], T[MOST][MOST], phi[MOST], last = -1.0;
  for (long i = 0; i < ns; i++) C[i][i] = P0[i];
  for (long t = 0; t < N; t++) {
    if (P)
      for (long i = 0; i < ns; i++) memcpy(P + (t * ns + i) * ns, C[i], sizeof(double) * (size_t)ns);
    for (long j = 0; j < m; j++) {
      double *g = K + (t * m + j) * ns, r = R[t * m + j];
      long s = sel[j];
      if (r < 0.0) {
        memset(g, 0, sizeof(double) * (size_t)ns);
        S[t * m + j] = 0.0;
        continue;
      }
      double v = C[s][s] + r;
      S[t * m + j] = v;
      for (long i = 0; i < ns; i++) g[i] = C[i][s] / v;
      for (long i = 0; i < ns; i++)
        for (long n = 0; n < ns; n++) C[i][n] -= g[i] * g[n] * v;
    }
    if (h[t] != last) {
      decay(L, h[t], tau, phi);
      last = h[t];
    }
    Step s = step_of(h[t], b[t], k[t], d[t]);
    transition(ns, &s, phi, A);
    for (long i = 0; i < ns; i++) {
      if (i < 2)
        for (long n = 0; n < ns; n++) {
          double sum = 0.0;
          for (long c = 0; c < ns; c++) sum += A[i][c] * C[c][n];
          T[i][n] = sum;
        }
      else
        for (long n = 0; n < ns; n++) T[i][n] = phi[i - 2] * C[i][n];
    }
    for (long i = 0; i < ns; i++)
      for (long n = 0; n <= i; n++) {
        double sum = 0.0;
        if (n < 2)
          for (long c = 0; c < ns; c++) sum += T[i][c] * A[n][c];
        else
          sum = phi[n - 2] * T[i][n];
        C[i][n] = C[n][i] = sum;
      }
    C[0][0] += s.bq * s.bq * Q[t];
    C[0][1] += s.bq * s.bv * Q[t];
    C[1][1] += s.bv * s.bv * Q[t];
    C[1][0] = C[0][1];
    for (long i = 0; i < L; i++) C[2 + i][2 + i] += (1.0 - phi[i] * phi[i]) * var[i];
  }
}

/* Innovations of C columns over their standard deviations, out (N, m, C); zero for rows without measurement.
   F: forces at the middle of the steps (N, C), or NULL. Y: measured less reference (N, m, C), or NULL.
   X: predicted states of the one column (N, ns), or NULL. */
void whiten(long N, long L, long m, const int *sel, const double *h, const double *b, const double *k,
            const double *d, const double *tau, const double *K, const double *S, const double *F,
            const double *Y, long C, double *out, double *X) {
  long ns = 2 + L;
  double *x = calloc((size_t)(ns * C), sizeof(double)), *e = calloc((size_t)C, sizeof(double));
  double phi[MOST], last = -1.0;
  if (!x || !e) {
    free(x);
    free(e);
    return;
  }
  for (long t = 0; t < N; t++) {
    if (X) memcpy(X + t * ns, x, sizeof(double) * (size_t)ns);
    for (long j = 0; j < m; j++) {
      const double *g = K + (t * m + j) * ns, *y = Y ? Y + (t * m + j) * C : NULL;
      double v = S[t * m + j], *o = out + (t * m + j) * C;
      if (v <= 0.0) {
        memset(o, 0, sizeof(double) * (size_t)C);
        continue;
      }
      const double *at = x + sel[j] * C;
      double w = 1.0 / sqrt(v);
      if (y)
        for (long c = 0; c < C; c++) e[c] = y[c] - at[c];
      else
        for (long c = 0; c < C; c++) e[c] = -at[c];
      for (long c = 0; c < C; c++) o[c] = w * e[c];
      for (long i = 0; i < ns; i++) {
        double gain = g[i], *xi = x + i * C;
        for (long c = 0; c < C; c++) xi[c] += gain * e[c];
      }
    }
    if (h[t] != last) {
      decay(L, h[t], tau, phi);
      last = h[t];
    }
    Step s = step_of(h[t], b[t], k[t], d[t]);
    double *q = x, *v = x + C;
    const double *f = F ? F + t * C : NULL;
    for (long c = 0; c < C; c++) e[c] = f ? f[c] : 0.0;
    for (long i = 0; i < L; i++) {
      double *l = x + (2 + i) * C;
      for (long c = 0; c < C; c++) {
        e[c] += l[c];
        l[c] *= phi[i];
      }
    }
    for (long c = 0; c < C; c++) {
      double old = q[c];
      q[c] = s.qq * old + s.qv * v[c] + s.bq * e[c];
      v[c] = s.vq * old + s.vv * v[c] + s.bv * e[c];
    }
  }
  free(x);
  free(e);
}

/* Smoothed states (N, ns) and their variances (N, ns), by the adjoint recursion of Bryson and Frazier.
   P, X, K, S as `gains` and `whiten` give them for the one column; e: its whitened innovations (N, m). */
void smooth(long N, long L, long m, const int *sel, const double *h, const double *b, const double *k,
            const double *d, const double *tau, const double *K, const double *S, const double *e,
            const double *P, const double *X, double *mean, double *variance) {
  long ns = 2 + L;
  double lambda[MOST] = {0}, L2[MOST][MOST] = {{0}}, A[MOST][MOST], T[MOST][MOST], phi[MOST], last = -1.0;
  for (long t = N - 1; t >= 0; t--) {
    if (h[t] != last) {
      decay(L, h[t], tau, phi);
      last = h[t];
    }
    if (t < N - 1) {
      Step s = step_of(h[t], b[t], k[t], d[t]);
      transition(ns, &s, phi, A);
      double old[MOST];
      memcpy(old, lambda, sizeof(old));
      for (long i = 0; i < ns; i++) {
        lambda[i] = 0.0;
        for (long n = 0; n < ns; n++) lambda[i] += A[n][i] * old[n];
      }
      for (long i = 0; i < ns; i++)
        for (long n = 0; n < ns; n++) {
          T[i][n] = 0.0;
          for (long c = 0; c < ns; c++) T[i][n] += L2[i][c] * A[c][n];
        }
      for (long i = 0; i < ns; i++)
        for (long n = 0; n < ns; n++) {
          L2[i][n] = 0.0;
          for (long c = 0; c < ns; c++) L2[i][n] += A[c][i] * T[c][n];
        }
    }
    for (long j = m - 1; j >= 0; j--) {
      double v = S[t * m + j];
      if (v <= 0.0) continue;
      const double *g = K + (t * m + j) * ns;
      long s = sel[j];
      double dot = 0.0, row[MOST], quad = 0.0;
      for (long i = 0; i < ns; i++) dot += g[i] * lambda[i];
      for (long i = 0; i < ns; i++) {
        row[i] = 0.0;
        for (long n = 0; n < ns; n++) row[i] += L2[i][n] * g[n];
      }
      for (long i = 0; i < ns; i++) quad += g[i] * row[i];
      lambda[s] -= dot + e[t * m + j] / sqrt(v);
      for (long i = 0; i < ns; i++) {
        L2[i][s] -= row[i];
        L2[s][i] -= row[i];
      }
      L2[s][s] += quad + 1.0 / v;
    }
    const double *p = P + t * ns * ns, *x = X + t * ns;
    for (long i = 0; i < ns; i++) {
      double moved = 0.0, narrowed = 0.0;
      for (long n = 0; n < ns; n++) {
        double sum = 0.0;
        moved += p[i * ns + n] * lambda[n];
        for (long c = 0; c < ns; c++) sum += L2[n][c] * p[c * ns + i];
        narrowed += p[i * ns + n] * sum;
      }
      mean[t * ns + i] = x[i] - moved;
      double left = p[i * ns + i] - narrowed;
      variance[t * ns + i] = left > 0.0 ? left : 0.0;
    }
  }
}
