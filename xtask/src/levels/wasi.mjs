// Runs a WASI command: `node wasi.mjs program.wasm [argument...]`, with our environment, no files.
import { readFileSync } from "node:fs";
import { argv, env, exit } from "node:process";
import { WASI } from "node:wasi";

const [program, ...words] = argv.slice(2);
// `returnOnExit` leaves a called `exit` by a JavaScript exception; node 20 then crashed at its end.
const wasi = new WASI({ version: "preview1", args: [program, ...words], env, returnOnExit: false });
const module = await WebAssembly.compile(readFileSync(program));
const instance = await WebAssembly.instantiate(module, wasi.getImportObject());
exit(wasi.start(instance));
