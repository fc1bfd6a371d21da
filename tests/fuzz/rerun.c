/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * Runs a fuzz target over files and folders of its corpus, in blocks of exactly their size so that sanitizers see any
 * byte too far; with MUTATIONS=n also over n mutations of each file, the same ones in every run. The one that is being
 * read is in the file mutation.bin; one that takes longer than a minute, or more than twice the memory of the file
 * itself and more than MAX_KILOBYTES, ends the program. TAP: one line a program.
 */
#include <dirent.h>
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

enum {
    MAX_SECONDS = 60,
    MAX_KILOBYTES = 64 << 10, // whatever the file is: sanitizers hold freed memory back, and threads have stacks
};

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static uint32_t next_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 32);
}

static uint32_t below(uint64_t *state, size_t limit)
{
    return limit ? (uint32_t)(next_random(state) % limit) : 0;
}

/* One edit: bytes, digits, words of a few values, or a part that is moved, doubled or cut off. The size is at most that
 * of the room. */
static size_t edit(uint8_t *bytes, size_t size, size_t room, uint64_t *state)
{
    static const uint32_t words[] = {0, 1, 0x7fffffff, 0x80000000, 0xffffffff, 0x01000000, 0xffff, 0x40000000};
    size_t at = below(state, size), length = 1 + below(state, 64);
    length = length < size - at ? length : size - at;
    switch (size ? below(state, 8) : 8) {
    case 0:
        bytes[at] ^= (uint8_t)(1u << below(state, 8));
        break;
    case 1:
        bytes[at] = (uint8_t)next_random(state);
        break;
    case 2:
        bytes[at] = (uint8_t)("0123456789-. \n<>/=\"e"[below(state, 20)]);
        break;
    case 3:
        if (size - at >= 4)
            memcpy(bytes + at, &words[below(state, sizeof words / sizeof *words)], 4);
        break;
    case 4:
        memmove(bytes + at, bytes + below(state, size - length + 1), length);
        break;
    case 5:
        memmove(bytes + at, bytes + at + length, size - at - length);
        return size - length;
    case 6:
        if (size + length > room)
            break;
        memmove(bytes + at + length, bytes + at, size - at);
        return size + length;
    case 7:
        return below(state, 4) ? size : at;
    default:
        break;
    }
    return size;
}

/* The most memory that the process held since the peak was forgotten, in kilobytes; 0 where the system does not say. */
static long peak_kilobytes(void)
{
    char line[256];
    long peak = 0;
    FILE *file = fopen("/proc/self/status", "r");
    while (file && fgets(line, sizeof line, file) && sscanf(line, "VmHWM: %ld", &peak) != 1)
        ;
    if (file)
        fclose(file);
    return peak;
}

static void forget_peak(void)
{
    int file = open("/proc/self/clear_refs", O_WRONLY);
    if (file < 0)
        return;
    if (write(file, "5", 1) != 1) // proc(5): the peak becomes what is held now
        perror("clear_refs");
    close(file);
}

/* Kilobytes that reading them takes at most, beyond what was held before. */
static long kilobytes_of(const uint8_t *bytes, size_t size)
{
    forget_peak();
    long before = peak_kilobytes();
    LLVMFuzzerTestOneInput(bytes, size);
    return peak_kilobytes() - before;
}

/* Reads mutations of a file, which differ by their number alone. */
static void mutate(const uint8_t *bytes, size_t size, unsigned long count)
{
    size_t room = size + 1024;
    long most = count ? 2 * kilobytes_of(bytes, size) : 0;
    most = most > MAX_KILOBYTES ? most : MAX_KILOBYTES;
    uint8_t *work = malloc(room);
    int copy = count && work ? open("mutation.bin", O_RDWR | O_CREAT | O_TRUNC, 0666) : -1;
    for (unsigned long n = 0; n < count && copy >= 0; n++) {
        uint64_t state = n * 2654435761u + size;
        size_t length = size;
        memcpy(work, bytes, size);
        for (uint32_t edits = 1 + below(&state, 6); edits > 0; edits--)
            length = edit(work, length, room, &state);
        uint8_t *exact = malloc(length ? length : 1);
        if (!exact || pwrite(copy, work, length, 0) != (ssize_t)length || ftruncate(copy, (off_t)length) != 0)
            abort();
        memcpy(exact, work, length);
        alarm(MAX_SECONDS);
        long took = kilobytes_of(exact, length);
        alarm(0);
        free(exact);
        if (took > most) {
            fprintf(stderr, "mutation.bin takes %ld kB, at most %ld are good\n", took, most);
            abort();
        }
    }
    if (copy >= 0)
        close(copy);
    free(work);
}

static int replay_file(const char *path)
{
    const char *mutations = getenv("MUTATIONS");
    FILE *file = fopen(path, "rb");
    if (!file)
        return 0;
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    uint8_t *bytes = size >= 0 ? malloc(size ? (size_t)size : 1) : NULL;
    int ran = bytes && fread(bytes, 1, (size_t)size, file) == (size_t)size;
    if (ran) {
        LLVMFuzzerTestOneInput(bytes, (size_t)size);
        mutate(bytes, (size_t)size, mutations ? strtoul(mutations, NULL, 10) : 0);
    }
    free(bytes);
    fclose(file);
    return ran;
}

static int replay_folder(const char *path)
{
    DIR *folder = opendir(path);
    struct dirent *entry;
    int ran = 0;
    char name[4096];
    if (!folder)
        return replay_file(path);
    while ((entry = readdir(folder)))
        if (entry->d_name[0] != '.' && snprintf(name, sizeof name, "%s/%s", path, entry->d_name) < (int)sizeof name)
            ran += replay_file(name);
    closedir(folder);
    return ran;
}

int main(int argc, char **argv)
{
    int ran = 0;
    LLVMFuzzerTestOneInput((const uint8_t *)"", 0);
    for (int i = 1; i < argc; i++)
        ran += replay_folder(argv[i]);
    struct rusage usage = {0};
    if (getenv("MUTATIONS") && getrusage(RUSAGE_SELF, &usage) == 0)
        printf("# at most %ld MB\n", usage.ru_maxrss / 1024);
    printf("%s 1 - %s: %d corpus files\n1..1\n", ran ? "ok" : "not ok", argv[0], ran);
    return ran ? 0 : 1;
}
