/* Vectors of 8 lanes, and normal random numbers on them: Threefry-2x64-20 (Salmon et al. 2011) and Box-Muller. */
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))
typedef double real __attribute__((vector_size(64)));
typedef uint64_t word __attribute__((vector_size(64)));

enum { OF_START = 1, OF_NOISE = 2, OF_BOUNDED_START = 3 }; /* purposes of a draw */
static const word COUNT = {0, 1, 2, 3, 4, 5, 6, 7};

INLINE real all(double value) { return (real){0} + value; }
INLINE real choose(word mask, real yes, real no) { return (real)(((word)yes & mask) | ((word)no & ~mask)); }

/* counter (a, b) under key (k0, k1); the result replaces the counter */
INLINE void threefry(uint64_t k0, uint64_t k1, word *a, word *b) {
    static const int turn[8] = {16, 42, 12, 31, 16, 32, 24, 21};
    const uint64_t key[3] = {k0, k1, k0 ^ k1 ^ UINT64_C(0x1BD11BDAA9FC1A22)};
    word x = *a + key[0], y = *b + key[1];
#pragma GCC unroll 20
    for (int r = 0; r < 20; r++) {
        x += y;
        y = ((y << turn[r % 8]) | (y >> (64 - turn[r % 8]))) ^ x;
        if (r % 4 == 3) {
            x += key[(r / 4 + 1) % 3];
            y += key[(r / 4 + 2) % 3] + (uint64_t)(r / 4 + 1);
        }
    }
    *a = x;
    *b = y;
}

/* uniform on [0, 1), 52 bits */
INLINE real uniform(word bits) { return (real)((bits >> 12) | UINT64_C(0x3FF0000000000000)) - 1.0; }

/* x = 2^e f with f in [1/sqrt 2, sqrt 2); log f = 2 artanh((f - 1) / (f + 1)), 10 terms: below one unit in the last place */
INLINE real logarithm(real x) {
    const word bits = (word)x, lifted = bits - UINT64_C(0x3FE6A09E667F3BCD);
    typedef int64_t whole __attribute__((vector_size(64)));
    const whole e = (whole)lifted >> 52;
    const real f = (real)(bits - ((word)e << 52)), s = (f - 1.0) / (f + 1.0), z = s * s;
    real sum = all(1.0 / 19.0);
    for (int k = 17; k > 0; k -= 2) sum = sum * z + 1.0 / k;
    return __builtin_convertvector(e, real) * 0x1.62e42fefa39efp-1 + 2.0 * s * sum;
}

/* sine and cosine of u turns, u in [0, 1): Taylor series within an eighth of a turn of the nearest quarter */
INLINE void sine_cosine(real u, real *sine, real *cosine) {
    static const double S[8] = {
        1.5707963267948966, -0.6459640975062462, 0.07969262624616703, -0.004681754135318687,
        0.00016044118478735975, -3.598843235212084e-06, 5.692172921967924e-08, -6.688035109811464e-10};
    static const double C[9] = {
        1.0, -1.2337005501361697, 0.253669507901048, -0.020863480763352957,
        0.0009192602748394263, -2.5202042373060596e-05, 4.710874778818169e-07, -6.386603083791849e-09,
        6.565963114979468e-11};
    const double shift = 0x1.8p52; /* adding it rounds to an integer, left in the low bits */
    const real lifted = 4.0 * u + shift, f = 4.0 * u - (lifted - shift), z = f * f;
    const word quarter = (word)lifted, swap = -(quarter & 1);
    real s = all(S[7]), c = all(C[8]);
    for (int k = 6; k >= 0; k--) s = s * z + S[k];
    for (int k = 7; k >= 0; k--) c = c * z + C[k];
    s *= f;
    *sine = (real)((word)choose(swap, c, s) ^ ((quarter & 2) << 62));
    *cosine = (real)((word)choose(swap, s, c) ^ (((quarter + 1) & 2) << 62));
}

INLINE real root(real x) {
    real r;
    for (int i = 0; i < 8; i++) r[i] = __builtin_sqrt(x[i]);
    return r;
}

/* the angle of (x, y), in [-pi, pi]: atan t = t - t^3/3 + ... for t up to tan(pi/8), 21 terms */
INLINE real angle(real y, real x) {
    const real X = choose((word)(x < 0.0), -x, x), Y = choose((word)(y < 0.0), -y, y);
    const word steep = (word)(Y > X);
    const real u = choose(steep, X, Y) / choose(steep, Y, X); /* in [0, 1] */
    const word large = (word)(u > 0.41421356237309503);
    const real t = choose(large, (u - 1.0) / (u + 1.0), u), z = t * t;
    real sum = all(1.0 / 43.0);
    for (int k = 41; k > 0; k -= 2) sum = 1.0 / k - z * sum;
    const real low = t * sum + choose(large, all(0x1.921fb54442d18p-1), all(0.0));
    const real half = choose(steep, 0x1.921fb54442d18p+0 - low, low);
    const real whole = choose((word)(x < 0.0), 0x1.921fb54442d18p+1 - half, half);
    return choose((word)(y < 0.0), -whole, whole);
}

/* less the nearest whole turn */
INLINE real wrapped(real angle) {
    const double shift = 0x1.8p52; /* adding it rounds to an integer */
    return angle - 0x1.921fb54442d18p+2 * ((angle * 0x1.45f306dc9c883p-3 + shift) - shift);
}

/* two standard normals of each trajectory */
INLINE void normals(uint64_t seed, uint64_t purpose, word trajectory, uint64_t index, real *first, real *second) {
    word a = trajectory, b = (word){0} + index;
    real sine, cosine;
    threefry(seed, purpose, &a, &b);
    sine_cosine(uniform(b), &sine, &cosine);
    const real radius = root(-2.0 * logarithm(1.0 - uniform(a)));
    *first = radius * cosine;
    *second = radius * sine;
}

/* normal, of variance one once it is cut at 2.1: the first of the trajectory's normals that is inside */
INLINE real bounded(uint64_t seed, word trajectory) {
    real x = all(0.0), pair[2];
    word open = ~(word){0};
    for (uint64_t index = 0;; index++) {
        normals(seed, OF_BOUNDED_START, trajectory, index, &pair[0], &pair[1]);
        for (int k = 0; k < 2; k++) {
            const real d = 1.2509323795 * pair[k];
            const word taken = open & (word)(d <= 2.1) & (word)(d >= -2.1);
            x = choose(taken, d, x);
            open &= ~taken;
        }
        uint64_t any = 0;
        for (int i = 0; i < 8; i++) any |= open[i];
        if (!any) return x;
    }
}
