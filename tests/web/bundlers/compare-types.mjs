// node compare-types.mjs FOLDER: holds the public members of the classes, as their .d.ts say, against those of
// the JavaScript itself: names, methods or properties, how many arguments they take, and whether one can be set.
import { join } from 'node:path';
import ts from 'typescript';

const [, , folder] = process.argv;
const options = {
  allowJs: true,
  checkJs: false,
  strict: false,
  target: ts.ScriptTarget.ES2022,
  module: ts.ModuleKind.NodeNext,
  moduleResolution: ts.ModuleResolutionKind.NodeNext,
  lib: ['lib.es2022.d.ts', 'lib.dom.d.ts', 'lib.dom.iterable.d.ts'],
};
const classes = [
  ['stream', 'TetlodStream'],
  ['element', 'TetlodView'],
];
const typesOf = (file) => join(folder, `${file}.d.ts`);
const codeOf = (file) => join(folder, 'code', `${file}.js`);
const program = ts.createProgram(classes.flatMap(([file]) => [typesOf(file), codeOf(file)]), options);
const checker = program.getTypeChecker();
const inherited = new Set(['addEventListener', 'removeEventListener', 'dispatchEvent']); // that only types say more of

// What a class has of its own, in the file that the path names; of its instances, or of itself.
function membersOf(path, name) {
  const source = program.getSourceFile(path);
  const found = new Map();
  const argumentsOf = ({ parameters }) =>
    parameters.filter((p) => (ts.isIdentifier(p.name) ? p.name.text !== 'this' : true));
  const isLeft = (p) => Boolean(p.questionToken || p.initializer || p.dotDotDotToken);
  const visit = (node) => {
    if (ts.isClassDeclaration(node) && node.name?.text === name) for (const member of node.members) take(member);
    else ts.forEachChild(node, visit);
  };
  const put = (key, what) => found.set(key, { ...found.get(key), ...what });
  const take = (member) => {
    if (!member.name || ts.isPrivateIdentifier(member.name)) return;
    const flags = ts.getCombinedModifierFlags(member);
    const key = `${flags & ts.ModifierFlags.Static ? 'static ' : ''}${member.name.getText(source)}`;
    if (ts.isMethodDeclaration(member)) {
      const given = argumentsOf(member);
      const least = given.filter((p) => !isLeft(p)).length;
      put(key, {
        kind: 'method',
        least: Math.min(least, found.get(key)?.least ?? Infinity),
        most: Math.max(given.length, found.get(key)?.most ?? 0),
      });
    } else if (ts.isGetAccessor(member)) put(key, { kind: 'property', gets: true });
    else if (ts.isSetAccessor(member)) put(key, { kind: 'property', sets: true });
    else if (ts.isPropertyDeclaration(member))
      put(key, { kind: 'property', gets: true, sets: !(flags & ts.ModifierFlags.Readonly) });
  };
  if (!checker.getSymbolAtLocation(source)) throw new Error(`${path} exports nothing`);
  visit(source);
  return found;
}

const complaints = [];
for (const [file, name] of classes) {
  const typed = membersOf(typesOf(file), name);
  const made = membersOf(codeOf(file), name);
  if (typed.size < 5 || made.size < 5) complaints.push(`${name} has ${typed.size} and ${made.size} members`);
  for (const key of new Set([...typed.keys(), ...made.keys()])) {
    if (inherited.has(key)) continue;
    const [type, code] = [typed.get(key), made.get(key)];
    const say = (what) => complaints.push(`${name}.${key}: ${what}`);
    if (!type) say('has no type');
    else if (!code) say('has a type, and is not there');
    else if (type.kind !== code.kind) say(`is a ${code.kind}, not a ${type.kind}`);
    else if (type.kind === 'method' && type.most !== code.most) say(`takes ${code.most} arguments, not ${type.most}`);
    else if (type.kind === 'method' && type.least < code.least) say(`needs ${code.least} arguments, not ${type.least}`);
    else if (type.kind === 'property' && type.sets && !code.sets) say('cannot be set');
    else if (type.kind === 'property' && type.gets && !code.gets) say('cannot be read');
  }
}
console.log(complaints.join('\n') || `all members hold`);
process.exit(complaints.length ? 1 : 0);
