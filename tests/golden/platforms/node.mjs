// Runs the scenes of golden hashes in WebAssembly: node node.mjs FILE.wasm [INDEX OF A SCENE].
import { readFile } from "node:fs/promises";

const [file, scene] = process.argv.slice(2);
const { instance } = await WebAssembly.instantiate(await readFile(file), {});
const { memory, backend_count, check_backend, trace_scene, text, text_len } = instance.exports;
const read = () => new TextDecoder().decode(new Uint8Array(memory.buffer, text(), text_len()));
if (scene === undefined) {
  for (let backend = 0; backend < backend_count(); backend += 1) {
    if (!check_backend(backend)) process.exitCode = 1;
    console.log(read());
  }
} else {
  trace_scene(Number(scene));
  process.stdout.write(read());
}
