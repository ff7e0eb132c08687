/* Reads the commands of a guard's or a shield's process, and the certified stop that follows each.
 *
 * The layout is that of docs/shield_memory.md. Exactly one program drives a robot by a
 * memory: it calls shield_position_at once in each of its periods, with times of a regular clock.
 * Where a command is late, positions go on along the stop of the last one, within all bounds.
 *
 *     shield_memory memory;
 *     shield_reader reader = {0};
 *     double q[SHIELD_JOINTS];
 *     if (shield_open(&memory, path) != 0) return 1;
 *     for (each period of the robot, t on CLOCK_MONOTONIC and not after now)
 *         if (shield_position_at(&reader, &memory, t, q) == 0) send(q);
 */
#ifndef SHIELD_MEMORY_H
#define SHIELD_MEMORY_H

#include <fcntl.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { SHIELD_VERSION = 2, SHIELD_HEADER = 128, SHIELD_COMMANDS = 1024, SHIELD_JOINTS = 64 };
enum { SHIELD_COUNT = 0, SHIELD_DOING = 1, SHIELD_ABOUT = 4 }; /* words of the header */
/* Words of the driver. */
enum { SHIELD_NEWEST, SHIELD_GOES_ON, SHIELD_LOOKS, SHIELD_FOLLOWS, SHIELD_LOOKED, SHIELD_DRIVER };
/* Times that differ by less are one, as a share of the period. */
#define SHIELD_SAME 1e-6

typedef union {
    uint64_t word;
    double number;
} shield_cell;

typedef struct {
    shield_cell *cells;
    shield_cell *driver; /* what the driver says */
    size_t joints, rows, obstacles;
    size_t end; /* first cell behind the commands */
} shield_memory;

typedef struct {
    uint64_t number, after;
    double time, period, silent_for;
    double q[SHIELD_JOINTS], v[SHIELD_JOINTS], a[SHIELD_JOINTS];
    double most[SHIELD_JOINTS], jerk[SHIELD_JOINTS]; /* infinite without a bound */
} shield_command;

typedef struct {
    int follows;
    double looked;
    double share; /* of the period, at which it has looked */
    shield_command command;
} shield_reader;

static inline uint64_t shield_get(const shield_cell *at)
{
    return __atomic_load_n(&at->word, __ATOMIC_ACQUIRE);
}

static inline void shield_set(shield_cell *at, uint64_t word)
{
    __atomic_store_n(&at->word, word, __ATOMIC_RELEASE);
}

static inline void shield_set_number(shield_cell *at, double number)
{
    shield_cell cell;
    cell.number = number;
    shield_set(at, cell.word);
}

static inline double shield_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Copy a record of some words: 1 if it is whole, 0 if it is being written. */
static inline int shield_read_record(const shield_cell *record, size_t words, shield_cell *copy)
{
    const uint64_t first = shield_get(record);
    memcpy(copy, record, words * sizeof(shield_cell));
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    return first != 0 && first == copy[words - 1].word && first == shield_get(record);
}

/* Open the memory of a property `path`: 0, or -1 if it is none. */
static inline int shield_open(shield_memory *memory, const char *path)
{
    struct stat file;
    const int descriptor = open(path, O_RDWR);
    if (descriptor < 0) return -1;
    void *cells = MAP_FAILED;
    if (fstat(descriptor, &file) == 0 && file.st_size >= 8 * SHIELD_HEADER)
        cells = mmap(NULL, (size_t)file.st_size, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
    close(descriptor);
    if (cells == MAP_FAILED) return -1;
    memory->cells = (shield_cell *)cells;
    const shield_cell *about = memory->cells + SHIELD_ABOUT;
    memory->joints = about[1].word, memory->rows = about[2].word, memory->obstacles = about[3].word;
    const size_t driver = SHIELD_HEADER + SHIELD_COMMANDS * (7 + 5 * memory->joints);
    memory->driver = memory->cells + driver;
    memory->end = driver + SHIELD_DRIVER;
    if (shield_get(about) == SHIELD_VERSION && memory->joints <= SHIELD_JOINTS) return 0;
    munmap(cells, (size_t)file.st_size);
    return -1;
}

/* Copy what stands where a command does, it, an older or a newer one: 1, or 0 if it is not whole. */
static inline int shield_read_command(const shield_memory *memory, uint64_t number,
                                      shield_command *command)
{
    shield_cell copy[7 + 5 * SHIELD_JOINTS];
    const size_t n = memory->joints, words = 7 + 5 * n, bytes = n * sizeof(double);
    const shield_cell *record = memory->cells + SHIELD_HEADER + (number % SHIELD_COMMANDS) * words;
    if (!shield_read_record(record, words, copy)) return 0;
    command->number = copy[1].word, command->after = copy[2].word;
    command->time = copy[3].number, command->period = copy[4].number;
    command->silent_for = copy[5].number;
    memcpy(command->q, copy + 6, bytes);
    memcpy(command->v, copy + 6 + n, bytes);
    memcpy(command->a, copy + 6 + 2 * n, bytes);
    memcpy(command->most, copy + 6 + 3 * n, bytes);
    memcpy(command->jerk, copy + 6 + 4 * n, bytes);
    return 1;
}

/* Find the last command that holds at a time, or the first one after: 1, or 0 if there is none. */
static inline int shield_newest(const shield_memory *memory, double t, shield_command *newest)
{
    const int goes_on = shield_get(memory->driver + SHIELD_GOES_ON) != 0;
    uint64_t number = shield_get(memory->driver + SHIELD_NEWEST);
    int found = 0;
    for (int k = 0; k < SHIELD_COMMANDS; ++k, --number) {
        shield_command command;
        if (!shield_read_command(memory, number, &command) || command.number != number) break;
        if (!isinf(command.time)) {
            *newest = command;
            found = 1;
            if (!goes_on || command.time <= t + SHIELD_SAME * command.period) break;
        }
        if (number == 0) break;
    }
    return found;
}

/* How far a joint gets in n periods, at an acceleration that changes by `change` from each to the
 * next. */
static inline double shield_way(double v, double a, double change, double n, double h)
{
    const double rise = a * n * (n + 1.0) / 2.0 + change * n * (n + 1.0) * (n + 2.0) / 6.0;
    return h * (n * v + h * rise);
}

static inline double shield_time_gain(double x)
{
    const double p = floor(x);
    return x > 0.0 ? (p + 1.0) * x - 0.5 * p * (p + 1.0) : 0.0;
}

static inline double shield_gaining(double y)
{
    const double p = floor(0.5 * (sqrt(1.0 + 8.0 * y) - 1.0));
    return y / (p + 1.0) + 0.5 * p;
}

/* The phases of a stop, see drake_rnn/robot/joint_stop.py: periods in which the acceleration falls
 * by a step, periods at the largest deceleration, and the deceleration of the one in between. */
static inline void shield_phases(double x, double slow, double most, double phases[3])
{
    static const double off[] = {0.0, -1.0, 1.0, -2.0, 2.0, -3.0, 3.0};
    double p = fmax(floor(x + most), 0.0);
    double left = p * x - 0.5 * p * (p + 1.0) - slow;
    const double full = shield_time_gain(most), m = fmax(ceil((left - full) / most), 0.0);
    double y = fmin(most, shield_gaining(fmax(left - m * most, 0.0)));
    if (left > full - most && (m > 0.0 || y >= p - x - 1.0)) {
        phases[0] = p, phases[1] = m, phases[2] = y;
        return;
    }
    const double least = fmax(floor(x), 0.0), slack = 1e-9 * (1.0 + fabs(x));
    const double guess =
        fmax(floor(x + sqrt(fmax(0.5 * x * x - 0.5 * x + 0.25 - slow, 0.0))), least);
    phases[0] = guess, phases[1] = 0.0, phases[2] = 0.0;
    for (size_t k = 0; k < sizeof off / sizeof *off; ++k) {
        p = guess + off[k];
        left = p * x - 0.5 * p * (p + 1.0) - slow;
        if (p < least || left < -slack) continue;
        y = shield_gaining(fmax(left, 0.0));
        if (p - x - 1.0 - slack <= y && y <= p - x + 1.0 + slack) {
            phases[0] = p, phases[2] = y;
            return;
        }
    }
}

/* Where the fastest stop of a joint has led after some samples: how far, and its velocity. The jerk
 * is infinite if it is not bounded. */
static inline void shield_stop_after(double v, double a, double most, double jerk, double h,
                                     double samples, double *way, double *velocity)
{
    *way = 0.0, *velocity = v;
    if (samples <= 0.0) return;
    if (isinf(jerk)) {
        const double speed = fabs(v), loss = fmin(most * h, 1e9);
        const double braking = fmin(samples, floor(speed / loss));
        *way = copysign(h * braking * (speed - 0.5 * loss * (braking + 1.0)), v);
        *velocity = copysign(fmax(speed - samples * loss, 0.0), v);
        return;
    }
    const double step = jerk * h;
    double x = a / step, slow = -v / (h * step), phases[3], n;
    const double mirror = slow > copysign(shield_time_gain(fabs(x) - 1.0), x) ? -1.0 : 1.0;
    x *= mirror, v *= mirror;
    shield_phases(x, mirror * slow, most / step, phases);
    const double p = phases[0], m = phases[1], last = phases[2], rise = floor(last);
    n = fmin(samples, p);
    double distance = shield_way(v, x * step, -step, n, h);
    v += h * step * n * (x - 0.5 * (n + 1.0));
    if ((n = fmin(samples - p, m)) > 0.0) {
        distance += shield_way(v, -most, 0.0, n, h);
        v -= h * n * most;
    }
    if (samples - p - m > 0.0) {
        v -= h * last * step;
        distance += h * v;
    }
    if ((n = fmin(samples - p - m - 1.0, rise)) > 0.0) {
        distance += shield_way(v, -last * step, step, n, h);
        v -= h * step * n * (last - 0.5 * (n + 1.0));
    }
    *way = mirror * distance;
    *velocity = samples >= p + m + 1.0 + rise ? 0.0 : mirror * v;
}

/* Where the joints are to be at a time, by a command or, if it goes on, by the stop after it. Times
 * of a regular clock that differ by their rounding alone are the same within a period. */
static inline void shield_position_of(shield_reader *reader, size_t joints, int goes_on, double t,
                                      double *q)
{
    const shield_command *command = &reader->command;
    const double h = command->period;
    const double samples =
        goes_on ? fmax(floor((t - command->time) / h + SHIELD_SAME), 0.0) : 0.0;
    double share = fmin(fmax((t - (command->time + samples * h)) / h, 0.0), 1.0);
    const double off = (share - reader->share) - round(share - reader->share);
    if (fabs(off) * h <= 8.0 * (nextafter(t, INFINITY) - t))
        share = fmin(fmax(share - off, 0.0), 1.0);
    reader->share = share;
    for (size_t j = 0; j < joints; ++j) {
        double way, v;
        shield_stop_after(command->v[j], command->a[j], command->most[j], command->jerk[j], h,
                          samples, &way, &v);
        q[j] = command->q[j] + way - (1.0 - share) * h * v;
    }
}

/* Find the command that is followed at a time, and say so: 0, or -1 if there is none at all, -2 if
 * more have come since it looked last than are kept, or the one that it follows was taken back as it
 * stood still for seconds: have the arm stop, and begin with {0} again; -3 if the time is after now
 * or before the last one. */
static inline int shield_look(shield_reader *reader, const shield_memory *memory, double t)
{
    shield_cell *driver = memory->driver;
    shield_command command;
    /* What begins to hold until then may still come, and would be followed by nobody. */
    if (!(t <= shield_now()) || (reader->follows && t < reader->looked)) return -3;
    shield_set_number(driver + SHIELD_LOOKS, t);
    __atomic_thread_fence(__ATOMIC_SEQ_CST);
    const int goes_on = shield_get(driver + SHIELD_GOES_ON) != 0;
    uint64_t number = reader->command.number + 1;
    if (!reader->follows) {
        if (!shield_newest(memory, t, &reader->command)) return -1;
        reader->follows = 1;
        reader->looked = -INFINITY;
        number = UINT64_MAX;
    }
    while (number != UINT64_MAX && shield_read_command(memory, number, &command) &&
           command.number >= number) {
        if (command.number > number) return -2;
        ++number;
        if (isinf(command.time)) continue;
        const double slack = SHIELD_SAME * command.period;
        if (command.time > t + slack) break;
        if (command.after < reader->command.number) return -2;
        if (command.after == reader->command.number &&
            (!goes_on || command.time > reader->looked + slack))
            reader->command = command;
    }
    reader->looked = t;
    shield_set(driver + SHIELD_FOLLOWS, reader->command.number);
    shield_set_number(driver + SHIELD_LOOKED, t);
    return 0;
}

/* Where the joints are to be at a time [s], not after now and no earlier one than before: 0, or what
 * shield_look returns. */
static inline int shield_position_at(shield_reader *reader, const shield_memory *memory, double t,
                                     double *q)
{
    const int result = shield_look(reader, memory, t);
    if (result != 0) return result;
    const int goes_on = shield_get(memory->driver + SHIELD_GOES_ON) != 0;
    shield_position_of(reader, memory->joints, goes_on, t, q);
    return 0;
}

#endif
