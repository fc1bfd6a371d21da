# SPDX-License-Identifier: BSD-3-Clause
"""The original's own merge tree, without the program, and what `tetlod features --json` says held against it.

Edges are joined from the highest down, each at its lower end (Kruskal), while the program adds vertices. All numbers
are those of the file: differences are compared as fractions, exactly."""
from fractions import Fraction

import numpy as np

KINDS = {'maximum': 1, 'minimum': -1, 'component above': 1, 'component below': -1}


class Joined:
    def __init__(self, count):
        self.parent = list(range(count))

    def root(self, vertex):
        parent = self.parent
        while parent[vertex] != vertex:
            parent[vertex] = parent[parent[vertex]]
            vertex = parent[vertex]
        return vertex


def edges_of(tets):
    pairs = np.concatenate([tets[:, [a, b]] for a in range(4) for b in range(a)])
    return np.unique(np.sort(pairs, axis=1), axis=0)


def bars(values, edges):
    """(peak's vertex, height, height where it ends) of every maximum; a body's highest ends at the body's least value.
    """
    joined, peak, found = Joined(len(values)), list(range(len(values))), []
    heights = values.tolist()
    saddles = np.minimum(values[edges[:, 0]], values[edges[:, 1]])
    for e in np.argsort(-saddles, kind='stable').tolist():
        a, b = joined.root(int(edges[e, 0])), joined.root(int(edges[e, 1]))
        if a == b:
            continue
        if heights[peak[a]] < heights[peak[b]]:
            a, b = b, a
        found.append((peak[b], heights[peak[b]], float(saddles[e])))
        joined.parent[b] = a
    least = {}
    for vertex, height in enumerate(heights):
        root = joined.root(vertex)
        least[root] = min(least.get(root, height), height)
    return found + [(peak[root], heights[peak[root]], low) for root, low in least.items()]


def long_bars(values, edges, persistence):
    limit = Fraction(persistence)
    return [bar for bar in bars(values, edges)
            if bar[1] - bar[2] > persistence * 0.999 and Fraction(bar[1]) - Fraction(bar[2]) > limit]


def components(values, edges, threshold, persistence):
    """Components above a threshold: highest vertex, its height, threshold."""
    joined, above = Joined(len(values)), values > threshold
    for a, b in edges[above[edges].all(axis=1)].tolist():
        joined.parent[joined.root(a)] = joined.root(b)
    best = {}
    for vertex in np.nonzero(above)[0].tolist():
        root = joined.root(vertex)
        if root not in best or values[best[root]] < values[vertex]:
            best[root] = vertex
    limit = Fraction(threshold) + Fraction(persistence)
    return [(v, float(values[v]), threshold) for v in best.values() if Fraction(float(values[v])) > limit]


def true_features(kind, values, edges, persistence, threshold=None):
    """Those of the original: vertex, value, value where it ends."""
    sign = KINDS[kind]
    if threshold is None:
        found = long_bars(sign * values, edges, persistence)
    else:
        found = components(sign * values, edges, sign * threshold, persistence)
    return [(vertex, sign * height, sign * end) for vertex, height, end in found]


def matches(proven, points, true):
    """Each proven one gets a feature of its own in its box, with a value that is said: None, or the one without."""
    fits = [[t for t, (vertex, value, _) in enumerate(true)
             if feature['lower'] <= value <= feature['upper'] and
             all(feature['box'][i] <= points[vertex][i] <= feature['box'][i + 3] for i in range(3))]
            for feature in proven]
    owner = {}

    def place(p, tried):
        for t in fits[p]:
            if t not in tried:
                tried.add(t)
                if t not in owner or place(owner[t], tried):
                    owner[t] = p
                    return True
        return False
    return next((feature for p, feature in enumerate(proven) if not place(p, set())), None)


def judge(said, points, values, edges, threshold=None):
    """What is wrong with an answer, or None."""
    for kind, count in said['counts'].items():
        true = true_features(kind, values, edges, said['persistence'], threshold)
        proven = [f for f in said['features'] if f['kind'] == kind and f['proven']]
        if len(proven) != count['proven'] or count['proven'] > len(true):
            return '%s: %d proven, the original has %d' % (kind, count['proven'], len(true))
        if count.get('at_most', len(true)) < len(true):
            return '%s: at most %d, the original has %d' % (kind, count['at_most'], len(true))
        lost = matches(proven, points, true)
        if lost:
            return '%s: nothing of the original is in %s' % (kind, lost)
    return None
