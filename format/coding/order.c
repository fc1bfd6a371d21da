/* SPDX-License-Identifier: BSD-3-Clause */
#include "format/coding/order.h"

struct models {
    struct tetlodi_number vertex, tet;
    struct tetlodi_bit first[4], second[4][4];
};

/* Each number as its distance from the one that would follow the last. */
static int code_numbers(struct tetlodi_coder *coder, struct tetlodi_number *models, uint32_t *numbers, uint32_t count)
{
    int64_t expected = 0;
    for (uint32_t i = 0; i < count; i++) {
        int64_t difference = code_number(coder, models, 0, numbers[i] - expected), number = expected;
        if (difference < -number || difference >= count - number)
            return 0;
        number += difference;
        numbers[i] = (uint32_t)number;
        expected = number + 1;
    }
    return 1;
}

/* An even permutation of four is given by where its first two are. */
static int code_corners(struct tetlodi_coder *coder, struct models *models, uint8_t corners[4])
{
    unsigned first = code_tree(coder, models->first, 2, corners[0] & 3u);
    unsigned second = code_tree(coder, models->second[first], 2, corners[1] & 3u), third = 0;
    if (first == second)
        return 0;
    while (third == first || third == second)
        third++;
    unsigned fourth = 6 - first - second - third;
    unsigned inversions = (first > second) + (first > third) + (first > fourth) + (second > third) + (second > fourth);
    corners[0] = (uint8_t)first;
    corners[1] = (uint8_t)second;
    corners[2] = (uint8_t)(inversions % 2 ? fourth : third);
    corners[3] = (uint8_t)(inversions % 2 ? third : fourth);
    return 1;
}

int tetlodi_order_code(struct tetlodi_coder *coder, struct tetlodi_order *order)
{
    struct models models;
    tetlodi_number_init(&models.vertex);
    tetlodi_number_init(&models.tet);
    tetlodi_bits_init(models.first, 4);
    tetlodi_bits_init(models.second[0], 16);
    int good = code_numbers(coder, &models.vertex, order->vertices, order->vertex_count) &&
               code_numbers(coder, &models.tet, order->tets, order->tet_count);
    for (size_t t = 0; t < order->tet_count && good; t++)
        good = code_corners(coder, &models, order->corners + 4 * t);
    return good && !coder->bad;
}
