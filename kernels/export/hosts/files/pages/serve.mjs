// Serves this folder: `node serve.mjs`, then open the address. Pages send what they have found, which is shown here;
// with --once this ends with it, and with status 1 if something is wrong.
import { readFile } from "node:fs/promises";
import { createServer } from "node:http";
import { extname } from "node:path";

const types = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript",
  ".mjs": "text/javascript",
  ".json": "application/json",
  ".wasm": "application/wasm",
  ".png": "image/png",
};
const once = process.argv.includes("--once");
const port = Number(process.argv.slice(2).find((word) => word !== "--once") ?? 8080);

async function answer(request, response) {
  if (request.method === "POST") {
    let told = "";
    for await (const part of request) {
      told += part;
    }
    console.log(told);
    response.end(() => once && process.exit(told.endsWith("\nright") ? 0 : 1));
    return;
  }
  const { pathname } = new URL(request.url, "http://localhost"); // has no `..`
  const path = pathname === "/" ? "/index.html" : pathname;
  try {
    const data = await readFile(`.${path}`);
    response.writeHead(200, { "content-type": types[extname(path)] ?? "application/octet-stream" });
    response.end(data);
  } catch {
    response.writeHead(404);
    response.end();
  }
}

const server = createServer(answer);
server.listen(port, "127.0.0.1", () => console.log(`http://127.0.0.1:${server.address().port}/`));
