/* SPDX-License-Identifier: BSD-3-Clause */
/*
 * In: a member's share, and what cuts stacks. Each thread takes a stack, codes it, and puts what it has come to. Out,
 * where the stream is written: all of it. A stack and a result become bytes, and are made of them, by one function
 * (parcel.h).
 */
#include "src/pipeline/share_pages.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "format/fail.h"
#include "src/util/array.h"
#include "src/util/parallel.h"
#include "src/util/parcel.h"

/* ---- bytes */

static void pass_field(struct channel *channel, struct tetlodi_write_field *field,
                       const struct tetlodi_write_input *in)
{
    double *values = (double *)(uintptr_t)field->values, *node_values = (double *)(uintptr_t)field->node_values;
    CHANNEL_VALUE(channel, *field);
    field->values = CHANNEL_WORDS(channel, values, (size_t)in->vertices * field->components, field->components);
    field->node_values = CHANNEL_WORDS(channel, node_values, (size_t)in->contractions * field->components,
                                       field->components);
}

static void pass_input(struct channel *channel, struct tetlodi_page_stack *stack)
{
    struct tetlodi_write_input *in = &stack->in, arrays = *in;
    CHANNEL_VALUE(channel, *in);
    double *positions = (double *)(uintptr_t)arrays.positions;
    double *node_positions = (double *)(uintptr_t)arrays.node_positions;
    uint32_t *corners = (uint32_t *)(uintptr_t)arrays.corners, *children = (uint32_t *)(uintptr_t)arrays.children;
    uint8_t *later = (uint8_t *)(uintptr_t)arrays.later;
    in->positions = CHANNEL_WORDS(channel, positions, 3 * (size_t)in->vertices, 3);
    in->node_positions = CHANNEL_WORDS(channel, node_positions, 3 * (size_t)in->contractions, 3);
    in->corners = CHANNEL_WORDS(channel, corners, 4 * (size_t)in->tets, 4);
    in->children = CHANNEL_WORDS(channel, children, 4 * (size_t)in->contractions, 4);
    in->later = CHANNEL_ARRAY(channel, later, in->vertices);
    in->levels = NULL;
    if (!channel->share->leads)
        stack->fields = array_zero(in->field_count, sizeof *stack->fields);
    in->fields = stack->fields;
    in->field_count = stack->fields ? in->field_count : 0;
    for (uint32_t f = 0; f < in->field_count; f++)
        pass_field(channel, &stack->fields[f], in);
}

static void pass_stack(struct channel *channel, struct tetlodi_page_stack *stack)
{
    CHANNEL_VALUE(channel, stack->level_count);
    CHANNEL_VALUE(channel, stack->vertices);
    CHANNEL_VALUE(channel, stack->tets);
    CHANNEL_VALUE(channel, stack->slowest);
    CHANNEL_VALUE(channel, stack->keeps_mesh);
    pass_input(channel, stack);
    CHANNEL_ARRAY(channel, stack->copied, (size_t)stack->in.field_count * MAX_COMPONENTS);
    CHANNEL_ARRAY(channel, stack->ends, stack->level_count);
    CHANNEL_WORDS(channel, stack->nodes, stack->vertices, 1);
    CHANNEL_WORDS(channel, stack->numbers, stack->tets, 1);
    CHANNEL_ARRAY(channel, stack->seams, stack->vertices);
    CHANNEL_ARRAY(channel, stack->leaves, stack->vertices);
    CHANNEL_ARRAY(channel, stack->places, stack->tets);
}

static void pass_frame(struct channel *channel, struct tetlodi_buffer *frame)
{
    uint64_t size = frame->size;
    CHANNEL_VALUE(channel, size);
    CHANNEL_ARRAY(channel, frame->bytes, size);
    frame->size = frame->bytes ? size : 0;
    frame->capacity = channel->share->leads ? frame->capacity : frame->size;
}

static void pass_result(struct channel *channel, struct tetlodi_stack_result *result)
{
    CHANNEL_VALUE(channel, result->level_count);
    CHANNEL_VALUE(channel, result->parts);
    CHANNEL_VALUE(channel, result->vertices);
    CHANNEL_VALUE(channel, result->tets);
    CHANNEL_ARRAY(channel, result->levels, result->level_count);
    size_t frames = (size_t)result->level_count * result->parts;
    if (!channel->share->leads)
        result->frames = array_zero(frames, sizeof *result->frames);
    for (size_t i = 0; i < frames && result->frames; i++)
        pass_frame(channel, &result->frames[i]);
    CHANNEL_WORDS(channel, result->nodes, result->vertices, 1);
    CHANNEL_WORDS(channel, result->numbers, result->tets, 1);
    CHANNEL_ARRAY(channel, result->leaves, result->vertices);
    CHANNEL_ARRAY(channel, result->places, result->tets);
}

/* Bytes of a stack or a result, or it of bytes; one of both is NULL. */
static enum tetlod_status pass(struct buffer *bytes, bool puts, struct tetlodi_page_stack *stack,
                               struct tetlodi_stack_result *result, struct tetlod_error *error)
{
    struct parcel parcel;
    parcel_begin(&parcel, bytes, puts);
    if (stack)
        pass_stack(&parcel.channel, stack);
    else
        pass_result(&parcel.channel, result);
    return parcel_end(&parcel, "the pages", error);
}

/* ---- a member */

struct coders {
    const struct work_share *share;
    const struct tetlodi_stack_work *work; /* NULL: this one helps */
    struct pool *pool;
    pthread_mutex_t lock; /* of what follows */
    enum tetlod_status status;
    struct tetlod_error *error;
};

static enum tetlod_status get_stack(const struct coders *coders, uint32_t number, struct buffer *input,
                                    struct tetlodi_page_stack *out, struct tetlod_error *error)
{
    return coders->work ? coders->work->cut(coders->work->opaque, number, out, error)
                        : pass(input, false, out, NULL, error);
}

static enum tetlod_status code_stack(const struct coders *coders, uint32_t number, struct buffer *input,
                                     struct tetlod_error *error)
{
    struct tetlodi_page_stack stack = {0};
    struct tetlodi_stack_result result = {0};
    struct buffer bytes = {0};
    enum tetlod_status status;
    TETLOD_TRY_DONE(get_stack(coders, number, input, &stack, error));
    TETLOD_TRY_DONE(tetlodi_stack_encode(&stack, &result, error));
    TETLOD_TRY_DONE(pass(&bytes, true, NULL, &result, error));
    status = coders->share->put(coders->share->opaque, number, bytes.bytes, bytes.size, error);
done:
    tetlodi_stack_fini(&stack);
    tetlodi_stack_result_fini(&result);
    buffer_fini(&bytes);
    return status;
}

/* A thread: stacks, as long as there are any and nothing has failed. */
static void code_taken(void *opaque, unsigned worker, size_t begin, size_t end)
{
    struct coders *coders = opaque;
    const struct work_share *share = coders->share;
    struct tetlod_error error = {0};
    struct buffer input = {0};
    enum tetlod_status status = TETLOD_OK;
    uint32_t number;
    (void)worker;
    (void)begin;
    (void)end;
    while (status == TETLOD_OK && share->take(share->opaque, &number, coders->work ? NULL : &input)) {
        status = code_stack(coders, number, &input, &error);
        buffer_fini(&input);
        input = (struct buffer){0};
    }
    pthread_mutex_lock(&coders->lock);
    if (status != TETLOD_OK && coders->status == TETLOD_OK) {
        coders->status = status;
        *coders->error = error;
    }
    pthread_mutex_unlock(&coders->lock);
}

static enum tetlod_status code_stacks(void *opaque)
{
    struct coders *coders = opaque;
    if (!coders->pool)
        return tetlodi_fail_nomem(coders->error, "the threads", 1);
    pool_run(coders->pool, pool_size(coders->pool), 1, code_taken, coders);
    return coders->status;
}

static enum tetlod_status pack_stack(void *opaque, uint32_t part, struct buffer *out, struct tetlod_error *error)
{
    const struct coders *coders = opaque;
    struct tetlodi_page_stack stack = {0};
    enum tetlod_status status = coders->work->cut(coders->work->opaque, part, &stack, error);
    if (status == TETLOD_OK)
        status = pass(out, true, &stack, NULL, error);
    tetlodi_stack_fini(&stack);
    return status;
}

static enum tetlod_status fetch(const struct work_share *share, uint32_t number, struct tetlodi_stack_result *out,
                                struct tetlod_error *error)
{
    struct buffer bytes = {0};
    enum tetlod_status status = share->get(share->opaque, number, SIZE_MAX, &bytes.bytes, &bytes.size, error);
    if (status == TETLOD_OK)
        status = pass(&bytes, false, NULL, out, error);
    buffer_fini(&bytes);
    return status;
}

/* The stage, of one that leads or helps. */
static enum tetlod_status run_stage(struct coders *coders, uint32_t count, unsigned threads)
{
    const struct work_input input = {pack_stack, coders};
    coders->pool = pool_new(threads ? threads : parallel_cores());
    pthread_mutex_init(&coders->lock, NULL);
    enum tetlod_status status = work_share_run(coders->share, count, NULL, coders->work ? &input : NULL, code_stacks,
                                               coders, coders->error);
    pthread_mutex_destroy(&coders->lock);
    pool_free(coders->pool);
    return status;
}

enum tetlod_status pages_share(void *opaque, const struct tetlodi_stack_work *work, struct tetlod_error *error)
{
    const struct page_sharing *sharing = opaque;
    const struct work_share *share = sharing->share;
    enum tetlod_status status = TETLOD_OK;
    if (work_has_helpers(share)) {
        enum work_call call = CALL_PAGES;
        uint32_t count = work->count;
        TETLOD_TRY(share->call(share, &call, &share, error));
        struct channel channel = {share, TETLOD_OK};
        CHANNEL_VALUE(&channel, count);
    }
    struct coders coders = {.share = share, .work = work, .error = error};
    TETLOD_TRY_DONE(run_stage(&coders, work->count, sharing->threads));
    for (uint32_t number = 0; number < work->count; number++)
        TETLOD_TRY_DONE(fetch(share, number, &work->results[number], error));
done:
    share->end(share->opaque);
    return status;
}

enum tetlod_status pages_help(const struct work_share *share, unsigned threads, struct tetlod_error *error)
{
    struct coders coders = {.share = share, .error = error};
    struct channel channel = {share, TETLOD_OK};
    uint32_t count = 0;
    CHANNEL_VALUE(&channel, count);
    enum tetlod_status status = run_stage(&coders, count, threads);
    share->end(share->opaque);
    return status;
}
