/* A source and a driver of a shield in a process of its own, without Python.
 *
 *     cc -O2 -o shield_client shield_client.c -lm
 *     ./shield_client /proc/PID/fd/N      which is what `shield.path` says
 *
 * It moves the first joint by 0.1 rad within a second, as a chunk of 11 positions. In place of a
 * robot, each tenth position on the way is printed. It ends when the arm is there. The layout is that
 * of docs/shield_memory.md.
 */
#include "shield_memory.h"

#include <stdio.h>

typedef shield_cell cell;

enum { RING = 4, MOVING = 2, POSITIONS = 0, MONOTONIC = 0 };
enum { BEHIND = 2, REFUSED = 20, STATUS = 22 }; /* words of a status */
enum { REFUSAL = 34, CHUNK_HEAD = 6 };

/* Write the first words of a record behind its first one, and then its last one. */
static void write_record(cell *record, size_t words, const cell *body, size_t used)
{
    const uint64_t number = record[0].word + 1;
    shield_set(&record[0], number);
    __atomic_thread_fence(__ATOMIC_SEQ_CST);
    memcpy(record + 1, body, used * sizeof(cell));
    shield_set(&record[words - 1], number);
}

int main(int argc, char **argv)
{
    shield_memory memory;
    if (argc != 2 || shield_open(&memory, argv[1]) != 0) {
        fprintf(stderr, "usage: shield_client PATH, where PATH is what shield.path says\n");
        return 1;
    }
    const size_t n = memory.joints, rows = memory.rows, columns = 1 + (n > 7 ? n : 7);
    const size_t chunk_words = CHUNK_HEAD + rows * columns + 1;
    const cell *status = memory.cells + memory.end;
    cell *chunks = memory.cells + memory.end + STATUS + (3 + 3 * memory.obstacles) + REFUSAL;

    cell about[STATUS] = {{0}};
    shield_reader reader = {0};
    double q[SHIELD_JOINTS];
    const double begin = shield_now();
    while (shield_position_at(&reader, &memory, begin, q) != 0) {
    }
    const double period = reader.command.period, goal = q[0] + 0.1;

    /* The chunk: number, time sent, clock, kind, rows; then of each row a time and a target. */
    cell body[CHUNK_HEAD - 1 + 11 * (1 + SHIELD_JOINTS)];
    memset(body, 0, sizeof body);
    const uint64_t number = shield_get(&memory.cells[SHIELD_COUNT]) + 1;
    body[0].word = number;
    body[1].number = begin;
    body[2].word = MONOTONIC;
    body[3].word = POSITIONS;
    body[4].word = 11;
    for (int k = 0; k < 11; ++k) {
        cell *row = body + CHUNK_HEAD - 1 + (size_t)k * columns;
        row[0].number = begin + 0.1 * k;
        for (size_t j = 0; j < n; ++j) row[1 + j].number = q[j];
        row[1].number = q[0] + 0.01 * k;
    }
    /* Of the rows only those in use are written. */
    cell *chunk = chunks + (number % RING) * chunk_words;
    write_record(chunk, chunk_words, body, CHUNK_HEAD - 1 + 11 * columns);
    shield_set(&memory.cells[SHIELD_COUNT], number);

    /* Times are those of a regular clock, whenever this loop runs. */
    for (int k = 1; k * period < 30.0 && shield_get(&memory.cells[SHIELD_DOING]) == MOVING; ++k) {
        const double t = begin + k * period, now = shield_now();
        if (t > now) usleep((useconds_t)(1e6 * (t - now)) + 1);
        while (shield_now() < t) {
        }
        if (shield_position_at(&reader, &memory, t, q) != 0) continue;
        if (k % 10 == 0 && shield_read_record(status, STATUS, about))
            printf("%.4f s: %.4f rad, %.4f rad behind\n", t - begin, q[0], about[BEHIND].number);
        if (fabs(q[0] - goal) < 1e-3 && t > begin + 1.0) {
            printf("there\n");
            return 0;
        }
    }
    fprintf(stderr, "shield_client: not there; %llu chunks were refused\n",
            (unsigned long long)about[REFUSED].word);
    return 2;
}
