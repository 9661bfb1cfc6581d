// The checker without a page: node command.cjs CERTIFICATE.json [ROBOT.urdf] [ROBOT.srdf] [SCENE.yaml] [PATH.json].
// Exit code 0 if the certificate holds, 1 if not, 2 if a file cannot be used. With --batch it reads lines from standard
// input, each a JSON object {files: names of files, texts: {name: text} of further ones, clearance}, and answers each with a line.
const fs = require("fs");
const path = require("path");
const readline = require("readline");
const vm = require("vm");

for (const name of JSON.parse(fs.readFileSync(path.join(__dirname, "parts.json"), "utf8"))) {
  vm.runInThisContext(fs.readFileSync(path.join(__dirname, name), "utf8"), { filename: name });
}
const { readFiles, checkAnyCertificate } = vm.runInThisContext("({ readFiles, checkAnyCertificate })");

const buffers = new Map();
const bufferOf = (file) => {
  if (!buffers.has(file)) {
    const bytes = fs.readFileSync(file);
    buffers.set(file, bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
  }
  return buffers.get(file);
};

/** The bytes of a file that another one names: beside it, absolute, or package://NAME/... in a folder above it. */
function lookup(name, from) {
  const plain = decodeURIComponent(name.replace(/^file:\/\//, ""));
  const candidates = [path.resolve(path.dirname(from), plain)];
  const inPackage = /^package:\/\/([^/]+)\/(.*)$/.exec(name);
  for (let folder = path.dirname(path.resolve(from)); inPackage !== null; folder = path.dirname(folder)) {
    candidates.push(path.join(folder, inPackage[1], inPackage[2]), path.join(folder, inPackage[2]));
    if (folder === path.dirname(folder)) break;
  }
  const found = candidates.find((file) => fs.existsSync(file) && fs.statSync(file).isFile());
  return found === undefined ? null : bufferOf(found);
}

function answer(files, texts, clearance) {
  try {
    const named = files.map((name) => ({ name, buffer: bufferOf(name) }));
    const written = Object.entries(texts).map(([name, text]) => ({ name, buffer: new TextEncoder().encode(text).buffer }));
    const given = readFiles([...named, ...written], lookup);
    if (given.certificate === null) throw new Error("no certificate among the files");
    return checkAnyCertificate(given.certificate, { ...given, clearance });
  } catch (error) {
    return { holds: false, fault: error.message, unreadable: true };
  }
}

const names = process.argv.slice(2);
if (names[0] === "--batch") {
  readline.createInterface({ input: process.stdin }).on("line", (line) => {
    const { files, texts, clearance } = JSON.parse(line);
    console.log(JSON.stringify(answer(files, texts, clearance)));
  });
} else {
  const { holds, fault, unreadable } = answer(names, {}, 0);
  console.log(holds ? "holds" : `does not hold: ${fault}`);
  process.exitCode = holds ? 0 : unreadable ? 2 : 1;
}
