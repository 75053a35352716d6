// Answers the requests of `wamnet conformance --program "node program.mjs"`, one JSON object a line (CNF-8, CNF-9).

import { createInterface } from "node:readline";
import { parseRequest } from "./json.mjs";
import { KINDS } from "./kinds.mjs";
import { answerText } from "./numbers.mjs";
import { Refusal } from "./refusal.mjs";

function answerTo(request) {
  const { id, kind, input } = request;
  if (kind === "hello") return { program: "wamnet in JavaScript", kinds: Object.keys(KINDS) };
  if (!Object.hasOwn(KINDS, kind)) return { id, unsupported: `${kind} is not implemented` };
  try {
    return { id, output: KINDS[kind](input) };
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    return { id, refused: error.message };
  }
}

for await (const line of createInterface({ input: process.stdin })) {
  process.stdout.write(`${answerText(answerTo(parseRequest(line)))}\n`);
}
