/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/catalogue.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "format/fail.h"
#include "src/report/info_json.h"
#include "src/util/array.h"

static const char suffix[] = ".tetlod";

/* A name of the table. Without dataset: a file that could not be opened, remembered so that it is tried and complained
 * of once. */
struct entry {
    char id[ID_CAPACITY];
    struct file_identity identity;
    struct dataset *dataset;
};

struct table {
    struct entry *entries; /* by id */
    size_t count, capacity;
};

struct replaced {
    struct dataset *dataset;
    double last_asked;
    struct replaced *next;
};

struct catalogue {
    pthread_mutex_t lock; /* over table and replaced */
    struct table table;
    struct replaced *replaced;
    char **paths;
    size_t path_count;
    double keep_replaced;
    void (*log)(void *opaque, const char *level, const char *message);
    void *log_opaque;
};

__attribute__((format(printf, 3, 4))) static void say(struct catalogue *catalogue, const char *level, const char *format,
                                                      ...)
{
    char message[640];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    if (catalogue->log)
        catalogue->log(catalogue->log_opaque, level, message);
}

static struct entry *find_entry(const struct table *table, const char *id)
{
    size_t low = 0, high = table->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        int order = strcmp(table->entries[middle].id, id);
        if (order == 0)
            return &table->entries[middle];
        if (order < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return NULL;
}

static bool insert_entry(struct table *table, const struct entry *entry)
{
    if (!array_reserve((void **)&table->entries, &table->capacity, table->count + 1, sizeof *entry))
        return false;
    size_t place = table->count;
    while (place && strcmp(table->entries[place - 1].id, entry->id) > 0)
        place--;
    memmove(table->entries + place + 1, table->entries + place, (table->count - place) * sizeof *entry);
    table->entries[place] = *entry;
    table->count++;
    return true;
}

static void table_fini(struct table *table)
{
    for (size_t i = 0; i < table->count; i++)
        dataset_release(table->entries[i].dataset);
    free(table->entries);
}

/* A scan in progress: the next table, and what it says to the caller of catalogue_open. */
struct scan {
    struct catalogue *catalogue;
    struct table next;
    bool complete; /* memory sufficed */
};

/* Takes one file, whose fd it takes over, into the next table. The old table is this thread's to read: nobody else
 * changes it. */
static enum tetlod_status take_file(struct scan *scan, const char *path, int fd, struct tetlod_error *error)
{
    struct catalogue *catalogue = scan->catalogue;
    struct entry entry = {0};
    struct tetlod_error inner = {0};
    enum tetlod_status status = TETLOD_OK;
    stream_id(path, entry.id, sizeof entry.id);
    if (!entry.id[0] || strcmp(entry.id, ".") == 0 || strcmp(entry.id, "..") == 0 || !identity_of(fd, &entry.identity)) {
        close(fd);
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: is not a regular file", path);
    }
    struct entry *known = find_entry(&catalogue->table, entry.id);
    if (find_entry(&scan->next, entry.id)) {
        close(fd);
        if (!known)
            say(catalogue, "warning", "%s: another stream has the id '%s' already; this one is not served", path, entry.id);
        return TETLOD_OK;
    }
    if (known && identity_same(&known->identity, &entry.identity)) {
        close(fd);
        entry.dataset = known->dataset ? dataset_hold(known->dataset) : NULL;
    } else {
        status = dataset_open(&entry.dataset, entry.id, fd, &inner);
        if (status == TETLOD_OK)
            say(catalogue, "info", "%s: serving %s, content id %s", path, entry.id, dataset_info(entry.dataset)->cid);
        else if (!error)
            say(catalogue, "warning", "%s: not served: %.200s", path, inner.message);
    }
    if (!insert_entry(&scan->next, &entry)) {
        dataset_release(entry.dataset);
        scan->complete = false;
    }
    return status == TETLOD_OK ? status : tetlodi_fail(error, status, "%s: %.200s", path, inner.message);
}

static bool is_stream_name(const char *name)
{
    size_t size = strlen(name);
    return name[0] != '.' && size >= sizeof suffix && strcmp(name + size - (sizeof suffix - 1), suffix) == 0;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

static enum tetlod_status take_folder(struct scan *scan, const char *path, int fd, struct tetlod_error *error)
{
    DIR *folder = fdopendir(fd);
    if (!folder) {
        close(fd);
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot list: %s", path, strerror(errno));
    }
    char **names = NULL;
    size_t count = 0, capacity = 0;
    struct dirent *item;
    while ((item = readdir(folder))) {
        if (!is_stream_name(item->d_name))
            continue;
        if (!array_reserve((void **)&names, &capacity, count + 1, sizeof *names) ||
            !(names[count] = strdup(item->d_name))) {
            scan->complete = false;
            break;
        }
        count++;
    }
    if (count)
        qsort(names, count, sizeof *names, by_name); // which of two same ids is served must not depend on the folder's order
    for (size_t i = 0; i < count; i++) {
        int file = openat(fd, names[i], O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
        if (file >= 0) {
            enum tetlod_status ignored = take_file(scan, names[i], file, NULL); // logged; the others are served
            (void)ignored;
        }
        free(names[i]);
    }
    free(names);
    closedir(folder);
    return TETLOD_OK;
}

static enum tetlod_status take_path(struct scan *scan, const char *path, struct tetlod_error *error)
{
    struct stat about;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd < 0)
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot open: %s", path, strerror(errno));
    if (fstat(fd, &about) == 0 && S_ISDIR(about.st_mode))
        return take_folder(scan, path, fd, error);
    return take_file(scan, path, fd, error);
}

/* Called with the lock held. What was replaced by another file stays readable; what was written over does not. */
static void replace_table(struct catalogue *catalogue, struct table *next, double now)
{
    for (size_t i = 0; i < catalogue->table.count; i++) {
        struct entry *old = &catalogue->table.entries[i];
        const struct entry *current = find_entry(next, old->id);
        bool replaced = old->dataset && !(current && current->dataset == old->dataset) && dataset_intact(old->dataset);
        struct replaced *kept = replaced ? array_new(1, sizeof *kept) : NULL;
        if (!kept)
            continue;
        *kept = (struct replaced){dataset_hold(old->dataset), now, catalogue->replaced};
        catalogue->replaced = kept;
    }
    table_fini(&catalogue->table);
    catalogue->table = *next;
}

static void drop_replaced(struct catalogue *catalogue, double oldest)
{
    for (struct replaced **link = &catalogue->replaced; *link;) {
        struct replaced *kept = *link;
        if (kept->last_asked >= oldest && dataset_intact(kept->dataset)) {
            link = &kept->next;
            continue;
        }
        *link = kept->next;
        dataset_release(kept->dataset);
        free(kept);
    }
}

void catalogue_scan(struct catalogue *catalogue, double now)
{
    struct scan scan = {catalogue, {0}, true};
    for (size_t i = 0; i < catalogue->path_count; i++) {
        enum tetlod_status gone = take_path(&scan, catalogue->paths[i], NULL); // a path may come back
        (void)gone;
    }
    if (!scan.complete) { // rather the old table than a part of the new one
        table_fini(&scan.next);
        return;
    }
    pthread_mutex_lock(&catalogue->lock);
    replace_table(catalogue, &scan.next, now);
    drop_replaced(catalogue, now - catalogue->keep_replaced);
    pthread_mutex_unlock(&catalogue->lock);
}

enum tetlod_status catalogue_open(struct catalogue **out, const struct catalogue_options *options,
                                  struct tetlod_error *error)
{
    *out = NULL;
    struct catalogue *catalogue = array_zero(1, sizeof *catalogue);
    if (!catalogue)
        return tetlodi_fail_nomem(error, "the catalogue", sizeof *catalogue);
    pthread_mutex_init(&catalogue->lock, NULL);
    catalogue->keep_replaced = options->keep_replaced;
    catalogue->log = options->log;
    catalogue->log_opaque = options->log_opaque;
    catalogue->paths = array_zero(options->path_count, sizeof *catalogue->paths);
    struct scan scan = {catalogue, {0}, catalogue->paths != NULL};
    enum tetlod_status status = TETLOD_OK;
    for (size_t i = 0; scan.complete && status == TETLOD_OK && i < options->path_count; i++) {
        catalogue->paths[i] = strdup(options->paths[i]);
        if (!catalogue->paths[i])
            scan.complete = false;
        else
            status = take_path(&scan, catalogue->paths[catalogue->path_count++], error);
    }
    if (status == TETLOD_OK && !scan.complete)
        status = tetlodi_fail_nomem(error, "the catalogue", options->path_count);
    catalogue->table = scan.next;
    if (status == TETLOD_OK)
        *out = catalogue;
    else
        catalogue_close(catalogue);
    return status;
}

void catalogue_close(struct catalogue *catalogue)
{
    if (!catalogue)
        return;
    table_fini(&catalogue->table);
    drop_replaced(catalogue, 1e300);
    for (size_t i = 0; i < catalogue->path_count; i++)
        free(catalogue->paths[i]);
    free(catalogue->paths);
    pthread_mutex_destroy(&catalogue->lock);
    free(catalogue);
}

struct dataset *catalogue_find(struct catalogue *catalogue, const char *id)
{
    pthread_mutex_lock(&catalogue->lock);
    struct entry *entry = find_entry(&catalogue->table, id);
    struct dataset *dataset = entry && entry->dataset ? dataset_hold(entry->dataset) : NULL;
    pthread_mutex_unlock(&catalogue->lock);
    return dataset;
}

static bool has_content(const struct dataset *dataset, const char *id, const char *cid)
{
    return strcmp(dataset_id(dataset), id) == 0 && strcmp(dataset_info(dataset)->cid, cid) == 0;
}

struct dataset *catalogue_find_content(struct catalogue *catalogue, const char *id, const char *cid, double now)
{
    struct dataset *dataset = NULL;
    pthread_mutex_lock(&catalogue->lock);
    struct entry *entry = find_entry(&catalogue->table, id);
    if (entry && entry->dataset && has_content(entry->dataset, id, cid))
        dataset = dataset_hold(entry->dataset);
    for (struct replaced *kept = catalogue->replaced; !dataset && kept; kept = kept->next)
        if (has_content(kept->dataset, id, cid)) {
            dataset = dataset_hold(kept->dataset);
            kept->last_asked = now;
        }
    pthread_mutex_unlock(&catalogue->lock);
    return dataset;
}

struct dataset **catalogue_list(struct catalogue *catalogue, size_t *out_count)
{
    size_t count = 0;
    pthread_mutex_lock(&catalogue->lock);
    struct dataset **list = array_new(catalogue->table.count, sizeof *list);
    for (size_t i = 0; list && i < catalogue->table.count; i++)
        if (catalogue->table.entries[i].dataset)
            list[count++] = dataset_hold(catalogue->table.entries[i].dataset);
    pthread_mutex_unlock(&catalogue->lock);
    *out_count = count;
    return list;
}

size_t catalogue_count(struct catalogue *catalogue)
{
    size_t count = 0;
    pthread_mutex_lock(&catalogue->lock);
    for (size_t i = 0; i < catalogue->table.count; i++)
        count += catalogue->table.entries[i].dataset != NULL;
    pthread_mutex_unlock(&catalogue->lock);
    return count;
}

uint64_t catalogue_memory(struct catalogue *catalogue)
{
    uint64_t bytes = 0;
    pthread_mutex_lock(&catalogue->lock);
    for (size_t i = 0; i < catalogue->table.count; i++)
        if (catalogue->table.entries[i].dataset)
            bytes += decoding_bytes(dataset_decoding(catalogue->table.entries[i].dataset));
    for (struct replaced *kept = catalogue->replaced; kept; kept = kept->next)
        bytes += decoding_bytes(dataset_decoding(kept->dataset));
    pthread_mutex_unlock(&catalogue->lock);
    return bytes;
}
