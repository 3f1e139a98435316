/* A moment filter of second or third order, as fast as this core does it: the limit of a workload's table.

   The arithmetic on unique nonzero moments is written by `text.py` into rates.h (RATE(component, its rate), read from
   at[]), update.h (x[] and y[] -> x[]), drift.h and observe.h (the same of a true state), and the constants into model.h.
   A trajectory is a lane of a vector of 8; VECTORS of these take turns. RK4 between measurements.
   Arrays are (blocks, measurements, ..., 64 lanes), 64-byte aligned. */
#include <stdint.h>

#include "normals.h"
#include "model.h"

#ifndef VECTORS
#define VECTORS 1
#endif
#define BLOCK 64
#define GROUP (8 * VECTORS)
#define EACH for (int i = 0; i < VECTORS; i++)

/* vectors that go through a stage of RK4 together, to hide each other's latency: those whose moments fit the registers */
enum { TOGETHER = COMPONENTS <= 3 ? VECTORS : 1 };

/* what a stage of RK4 does with a rate; the stages go x -> a -> b -> a -> x */
#define RATE(c, value)                                                   \
    do {                                                                 \
        const real rate = value;                                         \
        if (s == 3) {                                                    \
            x[c] += STEP / 6.0 * (sum[c] + rate);                        \
        } else {                                                         \
            sum[c] = s == 0 ? rate : sum[c] + 2.0 * rate;                \
            to[c] = x[c] + (s == 2 ? STEP : 0.5 * STEP) * rate;          \
        }                                                                \
    } while (0)

INLINE void moments_stage(int s, const real *at, real *x, real *to, real *sum) {
#include "rates.h"
}

INLINE void truth_stage(int s, const real *at, real *x, real *to, real *sum) {
#include "drift.h"
}

#define RK4(stage, count)                                                          \
    for (int g = 0; g < VECTORS; g += TOGETHER) {                                  \
        real sum[TOGETHER][count], a[TOGETHER][count], b[TOGETHER][count];         \
        for (int i = 0; i < TOGETHER; i++) stage(0, x[g + i], x[g + i], a[i], sum[i]); \
        for (int i = 0; i < TOGETHER; i++) stage(1, a[i], x[g + i], b[i], sum[i]); \
        for (int i = 0; i < TOGETHER; i++) stage(2, b[i], x[g + i], a[i], sum[i]); \
        for (int i = 0; i < TOGETHER; i++) stage(3, a[i], x[g + i], a[i], sum[i]); \
    }

INLINE void rk4(real x[VECTORS][COMPONENTS]) { RK4(moments_stage, MOVING) }
INLINE void rk4_truth(real x[VECTORS][STATES]) { RK4(truth_stage, STATES) }

INLINE void update(real *x, const real *y) {
#include "update.h"
}

INLINE void observe(const real *x, real *h) {
#include "observe.h"
}

INLINE void start(real *x) {
    for (int c = 0; c < COMPONENTS; c++) x[c] = all(START_AT[c]);
}

/* y (blocks, times, MEASURED, 64) -> moments after each update (blocks, times, COMPONENTS, 64) */
void filter(int64_t blocks, int64_t times, const double *measured, double *out) {
    for (int64_t b = 0; b < blocks; b++)
        for (int lane = 0; lane < BLOCK; lane += GROUP) {
            real x[VECTORS][COMPONENTS];
            EACH start(x[i]);
            for (int64_t t = b * times; t < (b + 1) * times; t++) {
                for (int j = 0; j < STEPS; j++) rk4(x);
                EACH {
                    real y[MEASURED];
                    for (int r = 0; r < MEASURED; r++)
                        y[r] = *(const real *)(measured + (t * MEASURED + r) * BLOCK + lane + 8 * i);
                    update(x[i], y);
                    for (int c = 0; c < COMPONENTS; c++)
                        *(real *)(out + (t * COMPONENTS + c) * BLOCK + lane + 8 * i) = x[i][SLOT[c]];
                }
            }
        }
}

/* Truth by the same RK4, measurements, filter -> error of the mean and the other moments after each update.
   Random numbers are a function of (seed, trajectory, purpose, index) alone. */
void experiment(int64_t blocks, int64_t times, uint64_t seed, uint64_t first, double *out) {
    for (int64_t b = 0; b < blocks; b++)
        for (int lane = 0; lane < BLOCK; lane += GROUP) {
            real x[VECTORS][COMPONENTS], truth[VECTORS][STATES], pair[VECTORS][2];
            word trajectory[VECTORS];
            EACH {
                trajectory[i] = first + b * BLOCK + lane + 8 * i + COUNT;
                start(x[i]);
                for (int k = 0; k < STATES; k++) {
                    if (k % 2 == 0) normals(seed, OF_START, trajectory[i], k / 2, &pair[i][0], &pair[i][1]);
                    truth[i][k] = MEAN[k] + DEVIATION[k] * (BOUNDED[k] ? bounded(seed, trajectory[i]) : pair[i][k % 2]);
                }
            }
            for (int64_t t = 0; t < times; t++) {
                for (int j = 0; j < STEPS; j++) {
                    rk4(x);
                    rk4_truth(truth);
                }
                EACH {
                    real y[MEASURED];
                    observe(truth[i], y);
                    for (int r = 0; r < MEASURED; r++) {
                        const int64_t k = t * MEASURED + r;
                        if (k % 2 == 0) normals(seed, OF_NOISE, trajectory[i], k / 2, &pair[i][0], &pair[i][1]);
                        y[r] += NOISE[r] * pair[i][k % 2];
                    }
                    update(x[i], y);
                    for (int c = 0; c < COMPONENTS; c++) {
                        const real value = x[i][SLOT[c]];
                        *(real *)(out + ((b * times + t) * COMPONENTS + c) * BLOCK + lane + 8 * i) =
                            c < STATES ? truth[i][c] - value : value;
                    }
                }
            }
        }
}

int components(void) { return COMPONENTS; }
int measurements(void) { return MEASURED; }

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
