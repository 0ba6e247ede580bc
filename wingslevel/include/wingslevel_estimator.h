/* wingslevel_estimator.h: an attitude estimator as a shared library, for `wingslevel fly --estimator ./mine.so`.
 *
 * A library exports five functions: describe, create, reset, update and destroy, each with a common prefix. The default
 * prefix is `wingslevel`; with another, name it behind the file: `--estimator ./mine.so:other` looks for
 * `other_describe` and so on. Declare them with WINGSLEVEL_ESTIMATOR(prefix), then define them:
 *
 *     #include <wingslevel_estimator.h>
 *     WINGSLEVEL_ESTIMATOR(wingslevel)
 *
 * Build:   cc -O2 -shared -fPIC -I"$(python -m wingslevel.include)" mine.c -o mine.so -lm
 *
 * Frames   b is the body: x forward, y right, z down.  e is the earth: north, east, down, at the launch point.
 * Names    quantity, frame, unit: v_e_m_s is a velocity in earth axes, in m/s.  SI units and radians throughout.
 * Signs    specific force is acceleration minus gravity: level at rest it reads (0, 0, -9.8).
 *          The true rate is the gyro reading minus the gyro bias.
 *
 * The functions are called from one thread, one at a time.  Several objects may exist in a process, and each flight
 * has a new one: keep all state in the object.  Code that keeps state in static variables sets WINGSLEVEL_STATIC_STATE.
 * The library owns what it allocates; pointers that it is given are valid during the call only.
 *
 * MIT licence.
 */
#ifndef WINGSLEVEL_ESTIMATOR_H
#define WINGSLEVEL_ESTIMATOR_H

#include <stdint.h>

/* Later versions append fields to the structs and raise this number.  A program that knows version N loads libraries of
 * versions 1 to N. */
#define WINGSLEVEL_ABI_VERSION 2

#if defined(_WIN32)
#define WINGSLEVEL_EXPORT __declspec(dllexport)
#else
#define WINGSLEVEL_EXPORT __attribute__((visibility("default")))
#endif

#ifdef __cplusplus
#define WINGSLEVEL_LINKAGE extern "C" WINGSLEVEL_EXPORT
#else
#define WINGSLEVEL_LINKAGE WINGSLEVEL_EXPORT
#endif

/* What the heading converges to without a magnetometer. */
enum { WINGSLEVEL_COURSE = 0, WINGSLEVEL_NOSE = 1 };

/* Instruments that the estimator uses: bits. */
enum {
    WINGSLEVEL_GYRO = 1,
    WINGSLEVEL_ACCELEROMETER = 2,
    WINGSLEVEL_GPS = 4,
    WINGSLEVEL_MAGNETOMETER = 8,
    WINGSLEVEL_AIRSPEED = 16
};

/* Properties of the library: bits. */
enum { WINGSLEVEL_STATIC_STATE = 1 /* state in static variables: each object gets its own copy of the library */ };

/* Health of an estimate. */
enum {
    WINGSLEVEL_STARTING = 0, /* heading not yet found */
    WINGSLEVEL_GOOD = 1,
    WINGSLEVEL_POOR = 2      /* coasting on gyros, or samples rejected */
};

/* One parameter.  One with the name of a known property of the instruments (docs/instruments.md), such as
 * "gps_latency_s", is set from the data sheet of the sensors that fly. */
typedef struct wingslevel_parameter {
    const char *name;     /* an identifier, with its unit: "gps_latency_s" */
    const char *unit;     /* "s"; "" if it has none */
    double default_value; /* of a flag: 0 or 1 */
    const char *doc;      /* one line: "time constant of the tilt higher: smoother; lower: recovers sooner" */
} wingslevel_parameter;

/* What the library is.  It and all that it points to live as long as the library. */
typedef struct wingslevel_description {
    uint32_t struct_size;       /* sizeof(wingslevel_description) */
    uint32_t abi_version;       /* WINGSLEVEL_ABI_VERSION */
    const char *name;           /* an identifier, for messages: "my_filter" */
    const char *doc;            /* one line, or "" */
    uint32_t heading_reference; /* WINGSLEVEL_COURSE or WINGSLEVEL_NOSE */
    uint32_t uses;              /* WINGSLEVEL_GYRO | ... */
    uint32_t flags;             /* 0, or WINGSLEVEL_STATIC_STATE */
    uint32_t parameter_size;    /* sizeof(wingslevel_parameter) */
    uint64_t parameter_count;
    const wingslevel_parameter *parameters; /* may be null if there are none */
} wingslevel_description;

/* The measurements of one tick, at the end of its inertial sample.  Anything may be NaN or absurd: sensors fail.
 * Columns of the GPS, magnetometer and air data hold the last report until the next; *_new says that one arrived. */
typedef struct wingslevel_measurements {
    uint32_t struct_size;   /* bytes that are valid here */
    uint32_t reserved;
    double t_s;             /* end of the sample interval, since power-up */
    double dt_s;            /* length of the sample interval; may jitter */
    double gyro_b_rad_s[3]; /* mean angular rate over the interval */
    double force_b_m_s2[3]; /* mean specific force over the interval */
    int64_t gps_new;        /* 1: a fix arrived in this tick */
    int64_t gps_valid;      /* 1: the last fix is usable */
    double gps_t_s;         /* when the fix was true; NaN without a stamp */
    double gps_p_e_m[3];    /* position from the launch point */
    double gps_v_e_m_s[3];  /* velocity over the ground */
    double gps_course_rad;  /* course over ground, from north over east, 0..2 pi */
    double gps_speed_m_s;   /* horizontal ground speed */
    int64_t mag_new;        /* 1: a magnetometer sample arrived in this tick */
    double mag_b_ut[3];     /* magnetic field, microtesla */
    int64_t air_new;        /* 1: airspeed or barometric height arrived in this tick */
    double equivalent_airspeed_m_s; /* sqrt(2 q / 1.225 kg/m3) of the pitot pressure q; NaN without a pitot tube */
    double baro_height_m;   /* above the launch point; NaN without a barometer */
} wingslevel_measurements;

/* The answer of update.  It is filled in before each call: R_eb and the wind with NaN, the rates with zero, health with
 * WINGSLEVEL_GOOD, rejected with -1.  Only R_eb must be set. */
typedef struct wingslevel_estimate {
    uint32_t struct_size;        /* bytes that may be written here */
    uint32_t health;             /* WINGSLEVEL_STARTING, _GOOD or _POOR */
    double R_eb[3][3];           /* body-to-earth rotation, row by row: v_e = R_eb v_b */
    double omega_b_rad_s[3];     /* rate less the gyro bias; the autopilot damps with it */
    double gyro_bias_b_rad_s[3]; /* what the gyro reads too much */
    double wind_e_m_s[3];        /* velocity of the air over the ground; NaN where not estimated */
    int64_t rejected;            /* ticks since the reset in which a sample was rejected; -1 if not counted */
} wingslevel_estimate;

/* Declares the five functions of a library.
 *
 * describe   abi_version is the latest version that the program knows.  Null if the library is for a later one.
 * create     a new object, or null with a one-line reason in `message`, at most message_size bytes with the final zero.
 *            parameters has one value for each of the description, in its order.
 * reset      power-up.  on_ground is the mean inertial sample of the aeroplane at rest (t_s, dt_s, gyro_b_rad_s,
 *            force_b_m_s2), null where the flight starts in the air.  Nothing of an earlier flight is left.
 * update     one tick; returns 0, or another number to end the flight as failed.
 * destroy    frees the object.
 */
#define WINGSLEVEL_ESTIMATOR(prefix)                                                                          \
    WINGSLEVEL_LINKAGE const wingslevel_description *prefix##_describe(uint32_t abi_version);                 \
    WINGSLEVEL_LINKAGE void *prefix##_create(const double *parameters, char *message, uint64_t message_size); \
    WINGSLEVEL_LINKAGE void prefix##_reset(void *object, const wingslevel_measurements *on_ground);           \
    WINGSLEVEL_LINKAGE int32_t prefix##_update(void *object, const wingslevel_measurements *measurements,     \
                                               wingslevel_estimate *estimate);                                \
    WINGSLEVEL_LINKAGE void prefix##_destroy(void *object);

#endif
