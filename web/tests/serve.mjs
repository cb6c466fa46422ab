// Serves a folder on the loopback address.
import { createReadStream } from "node:fs";
import { stat } from "node:fs/promises";
import { createServer } from "node:http";
import { extname, join, normalize, sep } from "node:path";

const TYPES = {
  ".css": "text/css",
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".json": "application/json",
  ".mjs": "text/javascript",
  ".png": "image/png",
  ".svg": "image/svg+xml",
  ".wasm": "application/wasm",
};

/// The path of the file of a request below one of the folders; none if there is no such file.
async function find(folders, url) {
  const path = decodeURIComponent(new URL(url, "http://localhost").pathname);
  for (const folder of folders) {
    let file = normalize(join(folder, path));
    if (file !== normalize(folder) && !file.startsWith(normalize(folder + sep))) continue;
    let found = await stat(file).catch(() => null);
    if (found?.isDirectory()) found = await stat((file = join(file, "index.html"))).catch(() => null);
    if (found?.isFile()) return file;
  }
  return null;
}

/// Serves the first of the folders that has a file; a free port unless one is named.
export async function serve(folders, port = 0) {
  const missing = [];
  const server = createServer(async (request, response) => {
    const file = await find(folders, request.url);
    if (file === null) {
      missing.push(request.url);
      response.writeHead(404).end("no such file");
      return;
    }
    const type = TYPES[extname(file)] ?? "application/octet-stream";
    response.writeHead(200, { "content-type": type, "cache-control": "no-store" });
    createReadStream(file).pipe(response);
  });
  await new Promise((done, failed) => server.once("error", failed).listen(port, "127.0.0.1", done));
  const close = () => new Promise((done) => (server.close(done), server.closeAllConnections()));
  return { address: `http://127.0.0.1:${server.address().port}/`, missing, close };
}
