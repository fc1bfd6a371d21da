/* SPDX-License-Identifier: BSD-3-Clause */
/* The table of formats: what io.c reads and writes, by content and by extension. */
#ifndef TETLOD_IO_REGISTRY_H
#define TETLOD_IO_REGISTRY_H

#include "src/io/readers/readers.h"
#include "src/io/writers/writers.h"

enum { MAX_EXTENSIONS = 14 };

/* What a mesh is read from: one file, a file and the solution that the user names, two files of one stem, or the folder
 * that an empty file marks. */
enum format_files { ONE, SOLUTION, SIBLING, FOLDER };

struct format {
    const char *name, *about, *extensions[MAX_EXTENSIONS];
    enum format_files files;
    io_sniffer *sniff; /* NULL: by extension alone */
    io_reader *read;   /* NULL: this binary does not read it */
    io_writer *write;
};

/* NULL if no format has the path's extension. */
const struct format *format_by_extension(const char *path);

/* What the first bytes say the file is; where several formats are possible, its name decides, because the values of one
 * format may spell another format's word. NULL: this binary does not read it. */
const struct format *format_find(const char *path, const unsigned char *bytes, size_t size);

/* NULL past the last. */
const struct format *format_at(size_t number);

#endif
