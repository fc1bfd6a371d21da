/* SPDX-License-Identifier: BSD-3-Clause */
#include "server/store/catalogue.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "format/fail.h"
#include "format/common/utf8.h"
#include "src/report/info_json.h"
#include "src/util/array.h"
#include "src/util/hash.h"
#include "src/util/utf8_clean.h"

static const char stream_ending[] = ".tetlod", hdf_ending[] = ".vtkhdf";

enum {
    PATH_CAPACITY = 4096,
    MAX_FILES = 1 << 20,
    CHECKED_AT_ONCE = 256 << 20, /* bytes that a scan holds against their digests before it goes on without */
};

/* A name of the table. Without dataset: a file that could not be opened, remembered so that it is tried and complained
 * of once. */
struct entry {
    char id[ID_CAPACITY];
    struct file_identity identity;
    struct dataset *dataset;
    size_t path; /* number of the path under which it was found */
};

struct table {
    struct entry *entries; /* by id */
    size_t count, capacity;
};

struct replaced {
    struct dataset *dataset;
    double last_asked;
    bool intact; /* at the last scan */
    struct replaced *next;
};

/* Complaints that were logged: each is made once, until a scan goes by without it. */
struct warnings {
    char **texts;
    bool *again; /* by this scan */
    size_t count, text_capacity, again_capacity;
};

struct catalogue {
    pthread_mutex_t lock; /* over table and replaced */
    struct table table;
    uint64_t digest; /* of the table */
    struct replaced *replaced;
    char **paths;
    size_t path_count;
    double keep_replaced;
    uint64_t checked_at_once;
    atomic_size_t troubles; /* of the last scan */
    atomic_bool stopping;
    struct warnings given;
    struct open_files *files;
    void (*log)(void *opaque, const char *level, const char *message);
    void *log_opaque;
};

__attribute__((format(printf, 3, 4))) static void say(struct catalogue *catalogue, const char *level,
                                                      const char *format,
                                                      ...)
{
    char message[640];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    utf8_clean(message); // a line is a line, whatever files are called
    if (catalogue->log)
        catalogue->log(catalogue->log_opaque, level, message);
}

/* Warns of a complaint, once as long as it lasts. */
__attribute__((format(printf, 2, 3))) static void complain(struct catalogue *catalogue, const char *format, ...)
{
    struct warnings *given = &catalogue->given;
    char message[640];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    for (size_t i = 0; i < given->count; i++)
        if (strcmp(given->texts[i], message) == 0) {
            given->again[i] = true;
            return;
        }
    say(catalogue, "warning", "%s", message);
    char *text = strdup(message); // where memory is out it is said again
    if (text && ARRAY_RESERVE(given->texts, given->text_capacity, given->count + 1) &&
        ARRAY_RESERVE(given->again, given->again_capacity, given->count + 1)) {
        given->texts[given->count] = text;
        given->again[given->count++] = true;
    } else
        free(text);
}

/* Forgets complaints that the scan did not repeat. */
static void forget_warnings(struct warnings *given, bool all)
{
    size_t kept = 0;
    for (size_t i = 0; i < given->count; i++) {
        if (all || !given->again[i])
            free(given->texts[i]);
        else {
            given->texts[kept] = given->texts[i];
            given->again[kept++] = false;
        }
    }
    given->count = kept;
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
    if (!ARRAY_RESERVE(table->entries, table->capacity, table->count + 1))
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
    size_t path;     /* number of the path that is looked at */
    size_t troubles; /* files and folders that could not be looked at: what was known of them stays */
    bool starting;   /* the first scan, which does not keep clients waiting for large folders */
    uint64_t left;   /* bytes that may still be checked */
};

/* Takes over into the next table what the current one has under a name. */
static void keep_entry(struct scan *scan, const struct entry *known)
{
    struct entry entry = *known;
    if (entry.dataset)
        dataset_hold(entry.dataset);
    if (!insert_entry(&scan->next, &entry)) {
        dataset_release(entry.dataset);
        scan->complete = false;
    }
}

/* A file that cannot be looked at now, for want of descriptors or because a disk is away: what was served of it
 * stays. */
static enum tetlod_status keep_file(struct scan *scan, const char *path, int why, struct tetlod_error *error)
{
    char id[ID_CAPACITY];
    stream_id(path, id, sizeof id);
    const struct entry *known = find_entry(&scan->catalogue->table, id);
    if (known && !find_entry(&scan->next, id))
        keep_entry(scan, known);
    if (!error)
        complain(scan->catalogue, "%s: cannot open: %s%s", path, strerror(why), known &&
                 known->dataset ? "; what is known of it is served on" : "");
    scan->troubles++;
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot open: %s", path, strerror(why));
}

/* Where a file is found again. */
static bool print_path(const struct scan *scan, int folder, const char *path, char out[static PATH_CAPACITY])
{
    const char *front = folder == AT_FDCWD ? "" : scan->catalogue->paths[scan->path];
    int size = snprintf(out, PATH_CAPACITY, "%s%s%s", front, *front ? "/" : "", path);
    return size > 0 && size < PATH_CAPACITY;
}

/* Holds a stream against its digests before it is listed, as every stream that comes while the server runs: it may be
 * half a copy. What the first scan finds is listed without where there is too much of it. Later scans check it, and
 * whoever reads it. */
static enum tetlod_status check_stream(struct scan *scan, struct dataset *dataset, struct tetlod_error *error)
{
    uint64_t bytes = dataset_info(dataset)->bytes;
    if (scan->starting && bytes > scan->left)
        return TETLOD_OK;
    scan->left -= bytes < scan->left ? bytes : scan->left;
    return dataset_check(dataset, &scan->catalogue->stopping, error);
}

/* Says once why a file is not served; a caller with `error` says it itself. */
static enum tetlod_status refuse_stream(struct scan *scan, const char *path, const struct tetlod_error *why,
                                        struct tetlod_error *error)
{
    if (!error && !atomic_load(&scan->catalogue->stopping))
        complain(scan->catalogue, "%s: not served: %s", path, why->message);
    return tetlodi_fail(error, why->status, "%s: %s", path, why->message);
}

static enum tetlod_status open_stream(struct scan *scan, int folder, const char *path, int fd, struct entry *entry,
                                      struct tetlod_error *error)
{
    struct tetlod_error inner = {0};
    char full[PATH_CAPACITY];
    bool fits = print_path(scan, folder, path, full);
    if (!fits)
        close(fd);
    enum tetlod_status status = fits ? dataset_open(&entry->dataset, entry->id, scan->catalogue->files, full, fd,
                                                    &entry->identity, &inner)
                                     : tetlodi_fail(&inner, TETLOD_ERR_IO, "the path is too long");
    if (status == TETLOD_OK)
        status = check_stream(scan, entry->dataset, &inner);
    if (status == TETLOD_OK) {
        say(scan->catalogue, "info", "%s: serving %s, content id %s", path, entry->id,
            dataset_info(entry->dataset)->cid);
        return TETLOD_OK;
    }
    dataset_release(entry->dataset);
    entry->dataset = NULL;
    if (status == TETLOD_ERR_IO || status == TETLOD_ERR_NOMEM || status == TETLOD_ERR_LIMIT)
        entry->identity = (struct file_identity){0}; // nothing is wrong with the file: the next scan tries again
    return refuse_stream(scan, path, &inner, error);
}

/* A file that is as it was. One that was listed unchecked is checked when its turn comes, one that a reader found
 * damaged now. */
static enum tetlod_status keep_stream(struct scan *scan, const char *path, const struct entry *known,
                                      struct tetlod_error *error)
{
    struct entry entry = *known;
    struct tetlod_error inner = {0};
    enum tetlod_status status = TETLOD_OK;
    bool turn = entry.dataset && !dataset_checked(entry.dataset) && scan->left;
    if (turn || (entry.dataset && dataset_damaged(entry.dataset))) {
        uint64_t bytes = dataset_info(entry.dataset)->bytes;
        scan->left -= bytes < scan->left ? bytes : scan->left;
        status = dataset_check(entry.dataset, &scan->catalogue->stopping, &inner);
    }
    if (status == TETLOD_ERR_CHECKSUM || status == TETLOD_ERR_TRUNCATED)
        entry.dataset = NULL;
    keep_entry(scan, &entry);
    return entry.dataset == known->dataset ? TETLOD_OK : refuse_stream(scan, path, &inner, error);
}

static enum tetlod_status refuse_file(struct scan *scan, const char *path, const char *why, struct tetlod_error *error)
{
    if (!error)
        complain(scan->catalogue, "%s: not served: %s", path, why);
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: %s", path, why);
}

/* A file that was not there when it was opened: it has just gone, or it is a link to nothing. */
static enum tetlod_status miss_file(struct scan *scan, int folder, const char *path, struct tetlod_error *error)
{
    struct stat about;
    if (fstatat(folder, path, &about, AT_SYMLINK_NOFOLLOW) == 0)
        return refuse_file(scan, path, "it is a link to nothing", error);
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot open: %s", path, strerror(ENOENT));
}

/* Takes one file of `folder` (or AT_FDCWD) into the next table. The old table is this thread's to read: nobody else
 * changes it. A file that is as it was is not opened. */
static enum tetlod_status take_file(struct scan *scan, int folder, const char *path, struct tetlod_error *error)
{
    struct catalogue *catalogue = scan->catalogue;
    struct entry entry = {.path = scan->path};
    struct file_identity seen;
    stream_id(path, entry.id, sizeof entry.id);
    if (!tetlodi_plain_text(entry.id, strlen(entry.id)))
        return refuse_file(scan, path, "the name is not UTF-8, or has control characters; rename it", error);
    const struct entry *known = find_entry(&catalogue->table, entry.id);
    if (find_entry(&scan->next, entry.id)) {
        complain(catalogue, "%s: another stream has the id '%s' already; this one is not served", path, entry.id);
        return TETLOD_OK;
    }
    if (known && identity_at(folder, path, &seen) && identity_same(&known->identity, &seen))
        return keep_stream(scan, path, known, error);
    int fd = openat(folder, path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd < 0)
        return errno == ENOENT ? miss_file(scan, folder, path, error) : keep_file(scan, path, errno, error);
    if (!entry.id[0] || strcmp(entry.id, ".") == 0 || strcmp(entry.id, "..") == 0 || !identity_of(fd, &seen)) {
        close(fd);
        return refuse_file(scan, path, "it is not a regular file", error);
    }
    if (!identity_settled(fd, &entry.identity)) { // the next scan finds it changed
        close(fd);
        if (known)
            keep_entry(scan, known);
        return tetlodi_fail(error, TETLOD_ERR_IO, "%s: it is being written", path);
    }
    enum tetlod_status status = open_stream(scan, folder, path, fd, &entry, error);
    if (!insert_entry(&scan->next, &entry)) {
        dataset_release(entry.dataset);
        scan->complete = false;
    }
    return status;
}

static bool ends_in(const char *name, const char *ending)
{
    size_t size = strlen(name), length = strlen(ending);
    return size > length && strcmp(name + size - length, ending) == 0;
}

static bool is_stream_name(const char *name)
{
    return name[0] != '.' && (ends_in(name, stream_ending) || ends_in(name, hdf_ending));
}

/* VTKHDF files are meshes of other programs, too: those without a stream in them (SPEC 3.10) are passed. */
static bool is_other_mesh(int folder, const char *name)
{
    static const char pointer[8] = "\x89TLH\r\n\x1a\n";
    char start[sizeof pointer];
    int fd = ends_in(name, hdf_ending) ? openat(folder, name, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY) : -1;
    if (fd < 0)
        return false; // what is wrong with it is said as of any other stream
    bool points = read(fd, start, sizeof start) == sizeof start && memcmp(start, pointer, sizeof start) == 0;
    close(fd);
    return !points;
}

static int by_name(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* A folder that cannot be listed: all that was found there stays. */
static enum tetlod_status keep_folder(struct scan *scan, const char *path, int why, struct tetlod_error *error)
{
    const struct table *table = &scan->catalogue->table;
    for (size_t i = 0; i < table->count; i++)
        if (table->entries[i].path == scan->path && !find_entry(&scan->next, table->entries[i].id))
            keep_entry(scan, &table->entries[i]);
    scan->troubles++;
    if (!error)
        complain(scan->catalogue, "%s: cannot look at it: %s; its streams are served on", path, strerror(why));
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot list: %s", path, strerror(why));
}

static int list_names(struct scan *scan, DIR *folder, char ***out_names, size_t *out_count)
{
    size_t capacity = 0;
    struct dirent *item;
    for (errno = 0; (item = readdir(folder)); errno = 0) {
        if (!is_stream_name(item->d_name))
            continue;
        if (!array_reserve((void **)out_names, &capacity, *out_count + 1, sizeof **out_names) ||
            !((*out_names)[*out_count] = strdup(item->d_name))) {
            scan->complete = false;
            return 0;
        }
        ++*out_count;
    }
    return errno;
}

static enum tetlod_status take_folder(struct scan *scan, const char *path, int fd, struct tetlod_error *error)
{
    DIR *folder = fdopendir(fd);
    if (!folder) {
        int why = errno;
        close(fd);
        return keep_folder(scan, path, why, error);
    }
    char **names = NULL;
    size_t count = 0;
    int why = list_names(scan, folder, &names, &count);
    if (count)
        // which of two same ids is served must not depend on the folder's order
        qsort(names, count, sizeof *names, by_name);
    for (size_t i = 0; i < count; i++) {
        scan->complete &= !atomic_load(&scan->catalogue->stopping);
        if (!why && scan->complete && !is_other_mesh(fd, names[i])) {
            enum tetlod_status ignored = take_file(scan, fd, names[i], NULL); // logged; the others are served
            (void)ignored;
        }
        free(names[i]);
    }
    free(names);
    closedir(folder);
    return why ? keep_folder(scan, path, why, error) : TETLOD_OK;
}

/* A path that was named and is gone: so are its streams, until it comes back. */
static enum tetlod_status lose_path(struct scan *scan, const char *path, struct tetlod_error *error)
{
    scan->troubles++;
    if (!error)
        complain(scan->catalogue, "%s: it is gone; its streams are no longer served", path);
    return tetlodi_fail(error, TETLOD_ERR_IO, "%s: cannot open: %s", path, strerror(ENOENT));
}

static enum tetlod_status take_path(struct scan *scan, const char *path, struct tetlod_error *error)
{
    struct stat about;
    if (stat(path, &about) == 0 && !S_ISDIR(about.st_mode))
        return take_file(scan, AT_FDCWD, path, error);
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY | O_DIRECTORY);
    if (fd >= 0)
        return take_folder(scan, path, fd, error);
    if (errno == ENOENT || errno == ENOTDIR)
        return lose_path(scan, path, error);
    return keep_folder(scan, path, errno, error);
}

/* With its end, so that two texts are not one. */
static uint64_t digest_text(uint64_t hash, const char *text)
{
    return hash_byte(hash_text(hash, text), 0);
}

static uint64_t digest_of(const struct table *table)
{
    uint64_t hash = HASH_START;
    for (size_t i = 0; i < table->count; i++)
        if (table->entries[i].dataset)
            hash = digest_text(digest_text(hash, table->entries[i].id), dataset_info(table->entries[i].dataset)->cid);
    return hash;
}

/* What the next table replaces by another file stays readable; what was written over does not. Looking at a file may
 * take long. */
static struct replaced *find_replaced(const struct catalogue *catalogue, const struct table *next, double now)
{
    struct replaced *first = NULL;
    for (size_t i = 0; i < catalogue->table.count; i++) {
        const struct entry *old = &catalogue->table.entries[i], *current = find_entry(next, old->id);
        bool replaced = old->dataset && !(current && current->dataset == old->dataset) && dataset_intact(old->dataset);
        struct replaced *kept = replaced ? array_new(1, sizeof *kept) : NULL;
        if (!kept)
            continue;
        *kept = (struct replaced){dataset_hold(old->dataset), now, true, first};
        first = kept;
    }
    return first;
}

/* Takes out what nobody has asked for since `oldest`, or is not as it was. */
static struct replaced *take_out(struct replaced **link, double oldest)
{
    struct replaced *out = NULL;
    while (*link) {
        struct replaced *kept = *link;
        if (kept->last_asked >= oldest && kept->intact) {
            link = &kept->next;
            continue;
        }
        *link = kept->next;
        kept->next = out;
        out = kept;
    }
    return out;
}

static void free_replaced(struct replaced *first)
{
    for (struct replaced *next; first; first = next) {
        next = first->next;
        dataset_release(first->dataset);
        free(first);
    }
}

/* Puts the next table in place. Only this thread changes the table and the list: files are looked at before the lock is
 * taken, which others wait for, and closed after. */
static void replace_table(struct catalogue *catalogue, const struct table *next, double now)
{
    struct table old = catalogue->table;
    struct replaced *replaced = find_replaced(catalogue, next, now), **end = &replaced;
    for (struct replaced *kept = catalogue->replaced; kept; kept = kept->next)
        kept->intact = dataset_intact(kept->dataset);
    while (*end)
        end = &(*end)->next;
    uint64_t digest = digest_of(next);
    pthread_mutex_lock(&catalogue->lock);
    *end = catalogue->replaced;
    catalogue->replaced = replaced;
    catalogue->table = *next;
    catalogue->digest = digest;
    replaced = take_out(&catalogue->replaced, now - catalogue->keep_replaced);
    pthread_mutex_unlock(&catalogue->lock);
    table_fini(&old);
    free_replaced(replaced);
}

void catalogue_scan(struct catalogue *catalogue, double now)
{
    struct scan scan = {.catalogue = catalogue, .complete = true, .left = catalogue->checked_at_once};
    for (size_t i = 0; i < catalogue->path_count; i++) {
        scan.path = i;
        enum tetlod_status gone = take_path(&scan, catalogue->paths[i], NULL); // a path may come back
        (void)gone;
    }
    if (!scan.complete) { // out of memory or stopped: rather the old table than a part of the new one
        table_fini(&scan.next);
        return;
    }
    atomic_store(&catalogue->troubles, scan.troubles);
    forget_warnings(&catalogue->given, false);
    replace_table(catalogue, &scan.next, now);
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
    catalogue->checked_at_once = options->checked_at_once ? options->checked_at_once : CHECKED_AT_ONCE;
    catalogue->log = options->log;
    catalogue->log_opaque = options->log_opaque;
    catalogue->paths = array_zero(options->path_count, sizeof *catalogue->paths);
    catalogue->files = open_files_new(options->most_files ? options->most_files : MAX_FILES);
    struct scan scan = {.catalogue = catalogue, .complete = catalogue->paths && catalogue->files, .starting = true,
                        .left = catalogue->checked_at_once};
    enum tetlod_status status = TETLOD_OK;
    for (size_t i = 0; scan.complete && status == TETLOD_OK && i < options->path_count; i++) {
        catalogue->paths[i] = strdup(options->paths[i]);
        if (!catalogue->paths[i])
            scan.complete = false;
        else {
            scan.path = catalogue->path_count++;
            status = take_path(&scan, catalogue->paths[scan.path], error);
        }
    }
    if (status == TETLOD_OK && !scan.complete)
        status = tetlodi_fail_nomem(error, "the catalogue", options->path_count);
    catalogue->table = scan.next;
    catalogue->digest = digest_of(&scan.next);
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
    free_replaced(catalogue->replaced);
    forget_warnings(&catalogue->given, true);
    free(catalogue->given.texts);
    free(catalogue->given.again);
    for (size_t i = 0; i < catalogue->path_count; i++)
        free(catalogue->paths[i]);
    free(catalogue->paths);
    open_files_free(catalogue->files);
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

struct dataset *catalogue_find_content(struct catalogue *catalogue, const char *id, const char *cid, double now)
{
    size_t size = strlen(cid);
    pthread_mutex_lock(&catalogue->lock);
    struct entry *entry = find_entry(&catalogue->table, id);
    struct dataset *dataset = entry && entry->dataset ? dataset_with_content(entry->dataset, cid, size) : NULL;
    for (struct replaced *kept = catalogue->replaced; !dataset && kept; kept = kept->next)
        if (strcmp(dataset_id(kept->dataset), id) == 0 && (dataset = dataset_with_content(kept->dataset, cid, size)))
            kept->last_asked = now;
    if (dataset)
        dataset_hold(dataset);
    pthread_mutex_unlock(&catalogue->lock);
    return dataset;
}

bool catalogue_has_content(struct catalogue *catalogue, const char *cid, size_t size)
{
    bool found = false;
    pthread_mutex_lock(&catalogue->lock);
    for (size_t i = 0; !found && i < catalogue->table.count; i++)
        found = catalogue->table.entries[i].dataset && dataset_with_content(catalogue->table.entries[i].dataset, cid,
                                                                            size);
    for (const struct replaced *kept = catalogue->replaced; !found && kept; kept = kept->next)
        found = dataset_with_content(kept->dataset, cid, size);
    pthread_mutex_unlock(&catalogue->lock);
    return found;
}

uint64_t catalogue_digest(struct catalogue *catalogue)
{
    pthread_mutex_lock(&catalogue->lock);
    uint64_t digest = catalogue->digest;
    pthread_mutex_unlock(&catalogue->lock);
    return digest;
}

void catalogue_stop(struct catalogue *catalogue)
{
    atomic_store(&catalogue->stopping, true);
}

size_t catalogue_troubles(struct catalogue *catalogue)
{
    return atomic_load(&catalogue->troubles);
}

size_t catalogue_open_files(struct catalogue *catalogue)
{
    return open_files_count(catalogue->files);
}

size_t catalogue_hanging(struct catalogue *catalogue, double seconds)
{
    return open_files_hanging(catalogue->files, seconds);
}

struct dataset **catalogue_list(struct catalogue *catalogue, size_t most, size_t *out_count, uint64_t *out_digest)
{
    size_t count = 0;
    pthread_mutex_lock(&catalogue->lock);
    struct dataset **list = array_new(catalogue->table.count, sizeof *list);
    for (size_t i = 0; list && i < catalogue->table.count && count < most; i++)
        if (catalogue->table.entries[i].dataset)
            list[count++] = dataset_hold(catalogue->table.entries[i].dataset);
    if (out_digest)
        *out_digest = catalogue->digest;
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
