/* A source and a receiver of a shield in a process of its own, without Python.
 *
 *     cc -O2 -o shield_client shield_client.c
 *     ./shield_client /proc/PID/fd/N      which is what `shield.path` says
 *
 * It moves the first joint by 0.1 rad within a second, as a chunk of 11 positions, prints each
 * tenth command on the way, and ends when the arm is there. The layout is that of docs/shield.md.
 */
#include <fcntl.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { VERSION = 1, HEADER = 128, RING = 4, MOVING = 2, POSITIONS = 0, MONOTONIC = 0 };
enum { COUNT = 0, DOING = 1, ABOUT = 4 };                  /* words of the header */
enum { NUMBER = 1, TIME = 2, Q = 5 };                       /* words of a command */
enum { BEHIND = 2, REFUSED = 19, STATUS = 21 };             /* words of a status */
enum { REFUSAL = 34, CHUNK_HEAD = 6, MOST_JOINTS = 64 };

typedef union {
    uint64_t word;
    double number;
} cell;

static uint64_t get(const cell *at) { return __atomic_load_n(&at->word, __ATOMIC_ACQUIRE); }

static void set(cell *at, uint64_t word) { __atomic_store_n(&at->word, word, __ATOMIC_RELEASE); }

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Copy a record of some words: 1 if it is whole, 0 if it is being written. */
static int read_record(const cell *record, size_t words, cell *copy)
{
    const uint64_t first = get(record);
    memcpy(copy, record, words * sizeof(cell));
    __atomic_thread_fence(__ATOMIC_ACQUIRE);
    return first != 0 && first == copy[words - 1].word && first == get(record);
}

/* Write the first words of a record behind its first one, and then its last one. */
static void write_record(cell *record, size_t words, const cell *body, size_t used)
{
    const uint64_t number = record[0].word + 1;
    set(&record[0], number);
    __atomic_thread_fence(__ATOMIC_SEQ_CST);
    memcpy(record + 1, body, used * sizeof(cell));
    set(&record[words - 1], number);
}

int main(int argc, char **argv)
{
    struct stat file;
    const int descriptor = argc == 2 ? open(argv[1], O_RDWR) : -1;
    if (descriptor < 0 || fstat(descriptor, &file) != 0) {
        fprintf(stderr, "usage: shield_client /proc/PID/fd/N, a shield's path\n");
        return 1;
    }
    cell *memory = mmap(NULL, (size_t)file.st_size, PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
    if (memory == MAP_FAILED || get(&memory[ABOUT]) != VERSION) {
        fprintf(stderr, "shield_client: this is no memory of version %d\n", VERSION);
        return 1;
    }
    const size_t n = memory[ABOUT + 1].word, rows = memory[ABOUT + 2].word;
    const size_t obstacles = memory[ABOUT + 3].word, columns = 1 + (n > 7 ? n : 7);
    const size_t command_words = 6 + 2 * n, chunk_words = CHUNK_HEAD + rows * columns + 1;
    const cell *command = memory + HEADER, *status = command + command_words;
    cell *chunks = memory + HEADER + command_words + STATUS + (3 + 3 * obstacles) + REFUSAL;

    cell last[6 + 2 * MOST_JOINTS], about[STATUS] = {{0}};
    while (!read_record(command, command_words, last)) {
    }
    const double goal = last[Q].number + 0.1, begin = now();

    /* The chunk: number, time sent, clock, kind, rows; then of each row a time and a target. */
    cell body[CHUNK_HEAD - 1 + 11 * (1 + MOST_JOINTS)];
    memset(body, 0, sizeof body);
    const uint64_t number = get(&memory[COUNT]) + 1;
    body[0].word = number;
    body[1].number = begin;
    body[2].word = MONOTONIC;
    body[3].word = POSITIONS;
    body[4].word = 11;
    for (int k = 0; k < 11; ++k) {
        cell *row = body + CHUNK_HEAD - 1 + (size_t)k * columns;
        row[0].number = begin + 0.1 * k;
        for (size_t j = 0; j < n; ++j) row[1 + j].number = last[Q + j].number;
        row[1].number = last[Q].number + 0.01 * k;
    }
    /* Of the rows only those in use are written. */
    cell *chunk = chunks + (number % RING) * chunk_words;
    write_record(chunk, chunk_words, body, CHUNK_HEAD - 1 + 11 * columns);
    set(&memory[COUNT], number);

    uint64_t printed = 0;
    while (now() < begin + 30.0 && get(&memory[DOING]) == MOVING) {
        if (read_record(command, command_words, last) && read_record(status, STATUS, about) &&
            last[NUMBER].word >= printed + 10) {
            printed = last[NUMBER].word;
            printf("%.4f s: %.4f rad, %.4f rad behind\n", last[TIME].number - begin, last[Q].number,
                   about[BEHIND].number);
            if (fabs(last[Q].number - goal) < 1e-3 && last[TIME].number > begin + 1.0) {
                printf("there\n");
                return 0;
            }
        }
        usleep(1000);
    }
    fprintf(stderr, "shield_client: not there; %llu chunks were refused\n",
            (unsigned long long)about[REFUSED].word);
    return 2;
}
