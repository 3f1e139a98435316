/* The third-order filter on dx/dt = -2x + .7 x^2, y = x + noise, as fast as this core does it: the limit of the table.

   Moments m, p, s (mean, variance, third central moment); RK4 between measurements, Table 5.1 of Culver (1969) at them.
   A trajectory is a lane; VECTORS vectors of 8 lanes stay in registers through a whole run, so that one vector's
   arithmetic hides the latency of another's. Arrays are (blocks, measurements, ..., 64 lanes), 64-byte aligned. */
#include <stdint.h>

#include "normals.h"

#ifndef VECTORS
#define VECTORS 4
#endif
#define BLOCK 64
#define GROUP (8 * VECTORS)
#define EACH for (int i = 0; i < VECTORS; i++)

static const double STEP = 0.02, MEAN = 2.0, VARIANCE = 0.16;
enum { STEPS = 5 }; /* RK4 steps between measurements */

typedef struct {
    real m[VECTORS], p[VECTORS], s[VECTORS];
} moments;

/* 16 operations a lane */
INLINE void rates(const moments *x, moments *k) {
    EACH {
        const real m = x->m[i], p = x->p[i], s = x->s[i], slope = 1.4 * m - 2.0;
        k->m[i] = m * (0.7 * m - 2.0) + 0.7 * p;
        k->p[i] = 2.0 * (slope * p + 0.7 * s);
        k->s[i] = 3.0 * (slope * s + 1.4 * (p * p));
    }
}

INLINE void advance(const moments *x, double h, const moments *k, moments *to) {
    EACH {
        to->m[i] = x->m[i] + h * k->m[i];
        to->p[i] = x->p[i] + h * k->p[i];
        to->s[i] = x->s[i] + h * k->s[i];
    }
}

/* 4 * 16 for the rates, 3 * (6 + 7) for the combinations: 103 operations a lane */
INLINE void rk4(moments *x) {
    moments sum, k, at;
    rates(x, &sum);
    advance(x, 0.5 * STEP, &sum, &at);
    rates(&at, &k);
    advance(&sum, 2.0, &k, &sum);
    advance(x, 0.5 * STEP, &k, &at);
    rates(&at, &k);
    advance(&sum, 2.0, &k, &sum);
    advance(x, STEP, &k, &at);
    rates(&at, &k);
    advance(&sum, 1.0, &k, &sum);
    advance(x, STEP / 6.0, &sum, x);
}

/* 32 operations a lane, each of the two divisions counted as one. H = 1, so B = 1 / (p + R) and G = 1 - p B = R B. */
INLINE void update(moments *x, const real *y, double variance) {
    EACH {
        const real m = x->m[i], p = x->p[i], s = x->s[i];
        const real B = 1.0 / (p + variance), eta = B * (y[i] - m), G = variance * B;
        const real squared = eta * eta, O = squared - B, E = (1.0 / 3.0) * squared - B;
        const real half = 0.5 * s, kappa = 1.0 / (1.0 + half * eta * E), gain = kappa * G;
        const real phi = gain * half * O, third = gain * s * G;
        const real psi = third * eta, phi2 = phi * phi, excess = psi - phi2;
        x->m[i] = m + p * eta + phi;
        x->p[i] = G * p + excess;
        x->s[i] = third * G - phi * (psi + 2.0 * excess);
    }
}

INLINE void start(moments *x) {
    EACH {
        x->m[i] = all(MEAN);
        x->p[i] = all(VARIANCE);
        x->s[i] = all(0.0);
    }
}

INLINE void store(double *to, const real *m, const real *p, const real *s) {
    EACH {
        ((real *)to)[i] = m[i];
        ((real *)(to + BLOCK))[i] = p[i];
        ((real *)(to + 2 * BLOCK))[i] = s[i];
    }
}

/* y (blocks, times, 64) -> moments after each update (blocks, times, 3, 64) */
void filter(int64_t blocks, int64_t times, double variance, const double *y, double *out) {
    for (int64_t b = 0; b < blocks; b++)
        for (int lane = 0; lane < BLOCK; lane += GROUP) {
            moments x;
            start(&x);
            for (int64_t t = b * times; t < (b + 1) * times; t++) {
                for (int j = 0; j < STEPS; j++) rk4(&x);
                update(&x, (const real *)(y + t * BLOCK + lane), variance);
                store(out + 3 * t * BLOCK + lane, x.m, x.p, x.s);
            }
        }
}

INLINE void rk4_truth(real *x) {
    EACH {
#define DRIFT(x) ((x) * (0.7 * (x) - 2.0))
        const real k1 = DRIFT(x[i]), x2 = x[i] + 0.5 * STEP * k1;
        const real k2 = DRIFT(x2), x3 = x[i] + 0.5 * STEP * k2;
        const real k3 = DRIFT(x3), x4 = x[i] + STEP * k3;
        x[i] += STEP / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + DRIFT(x4));
    }
}

/* Truth by the same RK4, measurements, filter -> error x - m, p, s after each update (blocks, times, 3, 64).
   Random numbers are a function of (seed, trajectory, purpose, index) alone; initial states as in `initial_state`. */
void experiment(int64_t blocks, int64_t times, double variance, uint64_t seed, uint64_t first, double *out) {
    const double root = __builtin_sqrt(variance);
    for (int64_t b = 0; b < blocks; b++)
        for (int lane = 0; lane < BLOCK; lane += GROUP) {
            moments x;
            real truth[VECTORS], noise[2][VECTORS], y[VECTORS], error[VECTORS];
            word trajectory[VECTORS];
            EACH {
                trajectory[i] = first + b * BLOCK + lane + 8 * i + COUNT;
                truth[i] = initial_state(seed, trajectory[i]);
            }
            start(&x);
            for (int64_t t = 0; t < times; t++) {
                if (t % 2 == 0) EACH normals(seed, NOISE, trajectory[i], t / 2, &noise[0][i], &noise[1][i]);
                for (int j = 0; j < STEPS; j++) {
                    rk4(&x);
                    rk4_truth(truth);
                }
                EACH y[i] = truth[i] + root * noise[t % 2][i];
                update(&x, y, variance);
                EACH error[i] = truth[i] - x.m[i];
                store(out + 3 * (b * times + t) * BLOCK + lane, error, x.p, x.s);
            }
        }
}

/* rounds * 12 * 8 fused multiply-adds, independent enough to fill every unit: the peak of this core */
double peak(int64_t rounds, double a, double b) {
    real x[12], sum = all(0.0);
    for (int i = 0; i < 12; i++) x[i] = all(i);
    for (int64_t k = 0; k < rounds; k++)
#pragma GCC unroll 12
        for (int i = 0; i < 12; i++) x[i] = x[i] * a + b;
    for (int i = 0; i < 12; i++) sum += x[i];
    return sum[0];
}
