# SPDX-License-Identifier: BSD-3-Clause
"""The description is valid OpenAPI 3.1, and the server does what it says: every operation is asked, well and badly."""
import json
import os
import re
import subprocess
import urllib.parse

import jsonschema

from served import SCRATCH, TETLOD, Server, run

FOLDER = os.path.join(SCRATCH, 'streams')
server = document = None


def resolve(value):
    while isinstance(value, dict) and '$ref' in value:
        node = document
        for part in value['$ref'].removeprefix('#/').split('/'):
            node = node[part.replace('~1', '/').replace('~0', '~')]
        value = node
    return value


def references(node):
    if isinstance(node, dict):
        if '$ref' in node:
            yield node
        for value in node.values():
            yield from references(value)
    elif isinstance(node, list):
        for value in node:
            yield from references(value)


def validator(schema):
    return jsonschema.Draft202012Validator({**schema, 'components': document['components']})


def test_document():
    assert re.fullmatch(r'3\.1\.\d+', document['openapi']) and document['info']['title'] and document['info']['version']
    ids = []
    for reference in references(document):
        resolve(reference)
    for path, item in document['paths'].items():
        assert path.startswith('/') and set(item) == {'get'}, path
        operation = item['get']
        ids.append(operation['operationId'])
        parameters = [resolve(p) for p in operation.get('parameters', [])]
        assert len({(p['name'], p['in']) for p in parameters}) == len(parameters), path
        for parameter in parameters:
            assert parameter['in'] in ('path', 'query', 'header') and parameter['schema'], parameter
            assert parameter['in'] != 'path' or parameter['required']
        assert set(re.findall(r'\{(\w+)\}', path)) == {p['name'] for p in parameters if p['in'] == 'path'}, path
        for status, answer in operation['responses'].items():
            assert re.fullmatch(r'[1-5]\d\d', status) and resolve(answer)['description']
    assert len(ids) == len(set(ids))
    for schema in document['components']['schemas'].values():
        jsonschema.Draft202012Validator.check_schema(schema)


def concrete(path, cid, **changes):
    """A path with its parameters' examples, and the query of those that are required."""
    operation = document['paths'][path]['get']
    query = {}
    for parameter in map(resolve, operation.get('parameters', [])):
        example = changes.get(parameter['name'], cid if parameter['name'] == 'cid' else parameter.get('example'))
        if isinstance(example, list):
            example = ','.join(map(str, example))
        if parameter['in'] == 'path':
            path = path.replace('{%s}' % parameter['name'], urllib.parse.quote(str(example)))
        elif parameter['in'] == 'query' and (parameter.get('required') or parameter['name'] in changes):
            query[parameter['name']] = example
    return path + ('?' + urllib.parse.urlencode(query) if query else '')


def check(path, asked, **headers):
    operation = document['paths'][path]['get']
    status, head, body = server.get(asked, **headers)
    assert str(status) in operation['responses'], (asked, status, body[:300])
    answer = resolve(operation['responses'][str(status)])
    for name in answer.get('headers', {}):
        assert name.lower() in head, (asked, status, name)
    media_type = head.get('content-type', '').split(';')[0]
    if status != 304 and 'content' in answer:
        assert media_type in answer['content'], (asked, media_type)
        schema = answer['content'][media_type].get('schema')
        if schema:
            validator(resolve(schema)).validate(json.loads(body))
    return status


def stream_for(path):
    """The stream that has what a path is about, as changes of its examples, and its content id."""
    id = 'run' if '{band}' in path else 'fin'
    return {'id': id, **({'error': '0.1'} if path.endswith(('/mesh', '/prefix')) else {})}, server.json('/v1/meshes/' + id)['cid']


def test_every_operation():
    for path in document['paths']:
        changes, cid = stream_for(path)
        status = check(path, concrete(path, cid, **changes))
        assert status == (303 if path.endswith('/mesh') else 200), (path, status)
        if '304' in document['paths'][path]['get']['responses']:
            asked = concrete(path, cid, **changes)
            assert check(path, asked, If_None_Match=server.get(asked)[1]['etag']) == 304
        if '416' in document['paths'][path]['get']['responses']:
            assert check(path, concrete(path, cid, **changes), Range='bytes=0-3') == 206
            assert check(path, concrete(path, cid, **changes), Range='bytes=999999999-') == 416
        if '404' in document['paths'][path]['get']['responses'] and '{id}' in path:
            assert check(path, concrete(path, cid, id='nothing')) == 404
        if '{cid}' in path:
            asked = concrete(path, cid, **changes)
            assert check(path, concrete(path, '0' * 32, **changes)) == 404
            assert check(path, asked + ('&' if '?' in asked else '?') + 'unknown=1') == 400
        if '{format}' in path:
            assert check(path, concrete(path, cid, **{**changes, 'format': 'doc'})) == 400
        for number in ('level', 'band', 'step', 'group'):
            if '{%s}' % number in path:
                assert check(path, concrete(path, cid, **{**changes, number: 99999})) == 400
        if '{band}' in path:
            assert check(path, concrete(path, server.json('/v1/meshes/fin')['cid'], id='fin')) == 404


def test_steps():
    for path, status in (('/v1/meshes/{id}/mesh', 303), ('/v1/meshes/{id}/prefix', 200)):
        for choice in ('time', 'step'):
            changes = {'id': 'run', 'error': '0.1', choice: '1'}
            asked = concrete(path, '', **changes)
            got, head, _ = server.get(asked)
            assert got == status and head['tetlod-step'] == '1', (asked, got, head)
            assert check(path, concrete(path, '', **{**changes, choice: 'x'})) == 400
            assert check(path, concrete(path, '', **{**changes, 'id': 'fin'})) == 404
            assert server.get(concrete(path, '', **changes) + '&abs_error=1')[0] == 400


def test_formats():
    for path in document['paths']:
        changes, cid = stream_for(path)
        for parameter in map(resolve, document['paths'][path]['get'].get('parameters', [])):
            if parameter['name'] == 'format':
                for name in parameter['schema']['enum']:
                    assert check(path, concrete(path, cid, **{**changes, 'format': name})) in (200, 303), (path, name)


os.makedirs(FOLDER, exist_ok=True)
subprocess.run([TETLOD, 'sample', 'fin', '--size', '6', '-o', 'fin.vtu'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'fin.vtu', '-o', os.path.join(FOLDER, 'fin.tetlod'), '--quiet'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'sample', 'wake', '--size', '4', '--steps', '2', '-o', 'run.pvd'], cwd=SCRATCH, check=True)
subprocess.run([TETLOD, 'build', 'run.pvd', '-o', os.path.join(FOLDER, 'run.tetlod'), '--bands', '10%,1%', '--quiet'], cwd=SCRATCH, check=True)
with Server(FOLDER) as server:
    document = server.json('/openapi.json')
    run([test_document, test_every_operation, test_steps, test_formats])
