/* A complementary filter on the rotation matrix: estimator/complementary.py in C, to copy for your own.
 *
 * Gyros are good in the short term, gravity and the GPS course in the long term.  Each sample turns the matrix by the
 * gyros, plus a small correction towards the two references; the tilt error, integrated, is the gyro bias.
 *
 *     cc -O2 -shared -fPIC -I"$(python -m wingslevel.include)" complementary.c -o complementary.so -lm
 *     wingslevel fly crosswind --estimator ./complementary.so --set complementary.tilt_s=10
 *
 * MIT licence.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <wingslevel_estimator.h>

WINGSLEVEL_ESTIMATOR(wingslevel)

#define G_M_S2 9.80665
#define GYRO_RANGE_RAD_S 36.651914291880923 /* 2100 deg/s: a reading beyond is no measurement */
#define FORCE_RANGE_M_S2 (17.0 * G_M_S2)
#define FASTEST_M_S 1000.0
#define MIN_SPEED_M_S 3.0         /* a slower course says nothing about the heading */
#define FIX_LIFE_S 2.0            /* nor does an older one */
#define GRAVITY_BAND_M_S2 3.0     /* further from g, the force is a throw or a pull-up, not gravity */
#define ALIGNED 0.3               /* sine of the heading error below which the heading counts as found */
#define AT_REST_RAD_S 0.78539816339744831
#define LONGEST_STEP_RAD 0.2

enum { TILT_S, HEADING_S, BIAS_S, GPS_LATENCY_S, GPS_FILTER_S, N_PARAMETERS };

static const wingslevel_parameter PARAMETERS[N_PARAMETERS] = {
    {"tilt_s", "s", 5.0, "time constant of the tilt correction higher: smoother; lower: follows accelerations too"},
    {"heading_s", "s", 2.0, "time constant of the heading correction higher: less course noise; lower: found sooner"},
    {"bias_s", "s", 20.0, "time constant of the gyro bias higher: steadier; lower: overshoots, keep above 4 tilt_s"},
    {"gps_latency_s", "s", 0.3, "age of a fix on arrival higher: more of the turn since then is added; lower: less"},
    {"gps_filter_s", "s", 0.0, "time constant of the receiver's filter higher: as for the latency; lower: likewise"},
};

static const wingslevel_description DESCRIPTION = {
    sizeof(wingslevel_description), WINGSLEVEL_ABI_VERSION, "complementary", "complementary filter on the matrix, in C",
    WINGSLEVEL_COURSE, WINGSLEVEL_GYRO | WINGSLEVEL_ACCELEROMETER | WINGSLEVEL_GPS, 0,
    sizeof(wingslevel_parameter), N_PARAMETERS, PARAMETERS,
};

typedef struct {
    double p[N_PARAMETERS];
    double R[3][3], omega[3], bias[3], v_e[3]; /* body-to-earth; rad/s; rad/s; m/s of the last fix */
    double t_s, fix_age_s, bad_s;
    int64_t rejected;
    int started, aligned;
} filter;

static int within(const double a[3], double limit) /* NaN is not */
{
    return fabs(a[0]) <= limit && fabs(a[1]) <= limit && fabs(a[2]) <= limit;
}

static double clip(double x, double limit) { return x < -limit ? -limit : x > limit ? limit : x; }

static double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* How much time a sample accounts for: lost samples are made up for; 0 if its time or interval cannot be true. */
static double interval(filter *s, const wingslevel_measurements *m)
{
    double dt = m->dt_s, gap = m->t_s - s->t_s;
    if (!isfinite(m->t_s) || !(dt >= 1e-6 && dt <= 0.5)) return 0.0;
    if (s->started) {
        if (gap < -1.0) s->t_s = m->t_s; /* the clock was set back */
        if (gap <= 0.0) return 0.0;
        if (gap > 1.5 * dt && gap <= 0.5) dt = gap;
    }
    s->started = 1;
    s->t_s = m->t_s;
    return dt;
}

/* The small rotation, in body axes, that brings the estimated down axis to the gravity felt. */
static void tilt_error(const filter *s, const double f[3], double error[3])
{
    double speed = sqrt(dot(s->v_e, s->v_e));
    double x = -f[0], y = s->omega[2] * speed - f[1], z = -s->omega[1] * speed - f[2]; /* omega x (speed, 0, 0) - f */
    double a = s->R[2][0] / G_M_S2, b = s->R[2][1] / G_M_S2, c = s->R[2][2] / G_M_S2;
    int gravity = !(fabs(sqrt(x * x + y * y + z * z) - G_M_S2) > GRAVITY_BAND_M_S2);
    error[0] = gravity ? y * c - z * b : 0.0; /* gravity x down */
    error[1] = gravity ? z * a - x * c : 0.0;
    error[2] = gravity ? x * b - y * a : 0.0;
}

/* Sine of the angle from the nose to the present course, positive to the right; 1 beyond a right angle. */
static double heading_error(const filter *s, double dt_s)
{
    double north = s->v_e[0], east = s->v_e[1], speed = sqrt(north * north + east * east), error;
    if (speed < MIN_SPEED_M_S || s->fix_age_s > FIX_LIFE_S) return 0.0;
    error = (s->R[0][0] * east - s->R[1][0] * north) / speed;
    if (s->R[0][0] * north + s->R[1][0] * east < 0.0) error = error > 0.0 ? 1.0 : -1.0;
    /* The aeroplane has gone on turning since the fix was true; the matrix is that of the sample before. */
    error += dot(s->R[2], s->omega) * (s->p[GPS_LATENCY_S] + s->p[GPS_FILTER_S] + s->fix_age_s - dt_s);
    return clip(error, 1.0);
}

/* Turn the matrix by omega dt and make it orthonormal again (Premerlani and Bizard, Eqns 17 to 21). */
static void turn(double R[3][3], const double omega[3], double dt)
{
    double x = omega[0] * dt, y = omega[1] * dt, z = omega[2] * dt, error, scale[3], r[2][3];
    int i, j;
    for (i = 0; i < 3; i++) {
        double a = R[i][0], b = R[i][1], c = R[i][2];
        R[i][0] = a + b * z - c * y;
        R[i][1] = b - a * z + c * x;
        R[i][2] = c + a * y - b * x;
    }
    error = dot(R[0], R[1]);
    for (j = 0; j < 3; j++) {
        r[0][j] = R[0][j] - 0.5 * error * R[1][j];
        r[1][j] = R[1][j] - 0.5 * error * R[0][j];
    }
    memcpy(R, r, sizeof r);
    for (j = 0; j < 3; j++) R[2][j] = R[0][(j + 1) % 3] * R[1][(j + 2) % 3] - R[0][(j + 2) % 3] * R[1][(j + 1) % 3];
    for (i = 0; i < 3; i++) scale[i] = 0.5 * (3.0 - dot(R[i], R[i]));
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) R[i][j] *= scale[i];
}

const wingslevel_description *wingslevel_describe(uint32_t abi_version)
{
    return abi_version >= WINGSLEVEL_ABI_VERSION ? &DESCRIPTION : NULL;
}

void *wingslevel_create(const double *parameters, char *message, uint64_t message_size)
{
    filter *s;
    int i;
    for (i = 0; i < N_PARAMETERS; i++) {
        int of_receiver = i == GPS_LATENCY_S || i == GPS_FILTER_S;
        if (!isfinite(parameters[i]) || (of_receiver ? parameters[i] < 0.0 : parameters[i] <= 0.0)) {
            snprintf(message, (size_t)message_size, "%s is %g s; it must be %s", PARAMETERS[i].name, parameters[i],
                     of_receiver ? "0 or more" : "above 0");
            return NULL;
        }
    }
    s = calloc(1, sizeof *s);
    if (s == NULL) return NULL;
    memcpy(s->p, parameters, sizeof s->p);
    wingslevel_reset(s, NULL);
    return s;
}

void wingslevel_reset(void *object, const wingslevel_measurements *on_ground)
{
    filter *s = object, fresh = {0};
    double roll = 0.0, pitch = 0.0, sr, cr, sp, cp;
    memcpy(fresh.p, s->p, sizeof fresh.p);
    *s = fresh;
    s->fix_age_s = INFINITY;
    if (on_ground != NULL) {
        const double *f = on_ground->force_b_m_s2;
        if (fabs(sqrt(dot(f, f)) / G_M_S2 - 1.0) < 0.2) { /* at rest, the force is minus gravity */
            roll = atan2(-f[1], -f[2]);
            pitch = atan2(f[0], hypot(f[1], f[2]));
        }
        if (within(on_ground->gyro_b_rad_s, AT_REST_RAD_S)) memcpy(s->bias, on_ground->gyro_b_rad_s, sizeof s->bias);
    }
    sr = sin(roll), cr = cos(roll), sp = sin(pitch), cp = cos(pitch); /* heading north */
    {
        const double R[3][3] = {{cp, sr * sp, cr * sp}, {0.0, cr, -sr}, {-sp, sr * cp, cr * cp}};
        memcpy(s->R, R, sizeof R);
    }
}

int32_t wingslevel_update(void *object, const wingslevel_measurements *m, wingslevel_estimate *estimate)
{
    filter *s = object;
    double dt = interval(s, m), tilt[3] = {0.0, 0.0, 0.0}, corrected[3], yaw, size;
    int i, parts, spoilt = 0;
    if (dt > 0.0) {
        int gyro_good = within(m->gyro_b_rad_s, GYRO_RANGE_RAD_S);
        int force_good = within(m->force_b_m_s2, FORCE_RANGE_M_S2);
        s->bad_s = gyro_good ? 0.0 : s->bad_s + dt;
        for (i = 0; i < 3; i++) /* a broken gyro: the last rate for a quarter of a second, then none */
            s->omega[i] = gyro_good ? m->gyro_b_rad_s[i] - s->bias[i] : s->bad_s > 0.25 ? 0.0 : s->omega[i];
        s->fix_age_s += dt;
        if (m->gps_new && within(m->gps_v_e_m_s, FASTEST_M_S)) {
            memcpy(s->v_e, m->gps_v_e_m_s, sizeof s->v_e);
            s->fix_age_s = 0.0;
        } else if (m->gps_new) {
            spoilt = 1;
        }
        spoilt |= !gyro_good || !force_good;
        if (force_good) tilt_error(s, m->force_b_m_s2, tilt);
        yaw = heading_error(s, dt);
        s->aligned |= s->fix_age_s < FIX_LIFE_S && fabs(yaw) > 0.0 && fabs(yaw) < ALIGNED;
        for (i = 0; i < 3; i++) {
            corrected[i] = s->omega[i] + (1.0 / s->p[TILT_S]) * tilt[i] + (yaw / s->p[HEADING_S]) * s->R[2][i];
            s->bias[i] = clip(s->bias[i] - dt / (s->p[TILT_S] * s->p[BIAS_S]) * tilt[i], AT_REST_RAD_S);
        }
        size = dt * dt * dot(corrected, corrected); /* Eqn 17 holds for small angles: turn in parts */
        parts = size > LONGEST_STEP_RAD * LONGEST_STEP_RAD ? 1 + (int)(sqrt(size) / LONGEST_STEP_RAD) : 1;
        for (i = 0; i < parts; i++) turn(s->R, corrected, dt / parts);
    } else {
        spoilt = 1;
    }
    s->rejected += spoilt;
    memcpy(estimate->R_eb, s->R, sizeof s->R);
    memcpy(estimate->omega_b_rad_s, s->omega, sizeof s->omega);
    memcpy(estimate->gyro_bias_b_rad_s, s->bias, sizeof s->bias);
    estimate->rejected = s->rejected;
    estimate->health = WINGSLEVEL_GOOD;
    if (spoilt || s->fix_age_s > FIX_LIFE_S) estimate->health = WINGSLEVEL_POOR;
    if (!s->aligned && dt > 0.0) estimate->health = WINGSLEVEL_STARTING;
    return 0;
}

void wingslevel_destroy(void *object) { free(object); }
