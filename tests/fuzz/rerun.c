/* SPDX-License-Identifier: BSD-3-Clause */
/* Runs a fuzz target over files and folders of its corpus, in blocks of exactly their size so that sanitizers see any
 * byte too far. TAP: one line a program. */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

static int replay_file(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file)
        return 0;
    fseek(file, 0, SEEK_END);
    long size = ftell(file);
    rewind(file);
    uint8_t *bytes = size >= 0 ? malloc(size ? (size_t)size : 1) : NULL;
    int ran = bytes && fread(bytes, 1, (size_t)size, file) == (size_t)size;
    if (ran)
        LLVMFuzzerTestOneInput(bytes, (size_t)size);
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
    printf("%s 1 - %s: %d corpus files\n1..1\n", ran ? "ok" : "not ok", argv[0], ran);
    return ran ? 0 : 1;
}
