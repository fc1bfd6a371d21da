#!/usr/bin/python3
# SPDX-License-Identifier: BSD-3-Clause
"""describe.py OUT: writes the description of the HTTP interface (OpenAPI 3.1). It is made of the table of routes,
server/routes/routes.def, and of what tables.py says about parameters and answers."""
import json
import os
import re
import sys

import tables

ROUTES = os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'routes', 'routes.def')
STATUS = {'Partial': '206', 'NotModified': '304', 'BadRequest': '400', 'NotFound': '404', 'OutOfRange': '416',
          'TooFine': '422', 'TooLarge': '422', 'Later': '503', 'Refused': 'default'}
INFO = {
    'title': 'tetlod', 'version': '1',
    'description': 'Levels of detail of tetrahedral volumes. Every answer to GET is also one to HEAD; OPTIONS answers '
                   'on every path (components.responses.Options). All other methods are refused with 405. Links, '
                   'Location and instance are relative references. An answer of 206 or 304 also has the headers of '
                   '200. Any answer may have the headers of components.x-headers. With --token, send Authorization: '
                   'Bearer TOKEN; /healthz and /readyz need none.',
    'license': {'name': 'BSD-3-Clause', 'identifier': 'BSD-3-Clause'}}


def entries(text):
    """Name and arguments of each entry of routes.def: C literals, of which adjacent ones are one."""
    text = re.sub(r'/\*.*?\*/', '', text, flags=re.S)
    for name, inside in re.findall(r'^(\w+)\((.*?)\)$', re.sub(r'"\s*\n\s*"', '', text), re.M | re.S):
        yield name, [literal if literal or not word else word
                     for literal, word in re.findall(r'"((?:[^"\\]|\\.)*)"|(\w+)', inside)]


def routes():
    """Template, query parameters, answer, operation and summary of each address."""
    with open(ROUTES, encoding='utf-8') as file:
        found = list(entries(file.read()))
    of_mesh = '/v1/meshes/{id}/{cid}/'
    for name, arguments in found:
        if name == 'ROUTE':
            template, _, _, query, answer, operation, summary = arguments
            yield template, query, answer, operation, summary
        else:
            what, _, query, answer, at_level, level_summary, at_step, step_summary = arguments
            yield '%slevels/{level}/%s.{format}' % (of_mesh, what), query, answer, at_level, level_summary
            template = '%sbands/{band}/steps/{step}/%s.{format}' % (of_mesh, what)
            yield template, query, 'step_' + answer, at_step, step_summary
    yield '/openapi.json', 'NULL', 'description', 'describe', 'This description'


def parameter_key(where, name, chosen=None):
    """The key in PARAMETERS of a parameter that a route names; `chosen` where there are several of that name."""
    keys = [key for key, one in tables.PARAMETERS.items() if one['in'] == where and (one['name'] or key) == name]
    if chosen:
        keys = [key for key in keys if key == chosen]
    if len(keys) != 1:
        sys.exit('server/routes/routes.def: server/api/tables.py has %d parameters %s in %s' % (len(keys), name, where))
    return keys[0]


def parameters(template, query, answer):
    keys = [parameter_key('path', name, answer['format'] if name == 'format' else None)
            for name in re.findall(r'\{(\w+)\}', template)]
    for one in query.split() if query != 'NULL' else ():
        name, _, chosen = one.partition(':')
        keys.append(parameter_key('query', name, chosen))
    return keys + ['range'] * ('Partial' in answer['also'])


def operation(template, query, answer, name, summary):
    answer = tables.ANSWERS[answer]
    keys = parameters(template, query, answer)
    first = {'description': answer['description'], 'content': answer['content']}
    if answer['headers']:
        first['headers'] = {one: tables.ref(one, 'headers') for one in answer['headers']}
    responses = {answer['status']: first}
    responses.update((STATUS[one], tables.ref(one, 'responses')) for one in answer['also'] + ['Later', 'Refused'])
    return {'operationId': name, 'summary': summary, 'responses': responses,
            **({'parameters': [tables.ref(key, 'parameters') for key in keys]} if keys else {})}


def document():
    return {
        'openapi': '3.1.0', 'info': INFO, 'servers': [{'url': '.'}],
        'paths': {template: {'get': operation(template, *rest)} for template, *rest in routes()},
        'components': {
            'parameters': {key: {**one, 'name': one['name'] or key} for key, one in tables.PARAMETERS.items()},
            'headers': tables.HEADERS, 'responses': tables.RESPONSES, 'schemas': tables.SCHEMAS,
            'x-headers': tables.ANY_HEADERS, 'x-files': tables.FILES}}


def main():
    os.makedirs(os.path.dirname(sys.argv[1]), exist_ok=True)
    with open(sys.argv[1], 'w', encoding='utf-8') as file:
        json.dump(document(), file, indent=1)
        file.write('\n')


if __name__ == '__main__':
    main()
