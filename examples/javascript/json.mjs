// JSON of untrusted files (RDG-2).
//
// Objects become Maps. Numbers keep whether they were written as integers, which a count (RDG-3) and a
// zero with a sign (SCN-10) depend on.

import { require, Refusal } from "./refusal.mjs";

const LARGEST_BYTES = 64 * 2 ** 20;
const MOST_DEPTH = 64;
const MOST_VALUES = 4_000_000;
const LONGEST_NUMBER = 1000;

const NUMBER = /-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?/y;
const LONE_SURROGATE = /\p{Surrogate}/u;
const ESCAPES = { '"': '"', "\\": "\\", "/": "/", b: "\b", f: "\f", n: "\n", r: "\r", t: "\t" };
const SPACES = new Set([" ", "\t", "\n", "\r"]);
const WORDS = { true: true, false: false, null: null };

export class JsonNumber {
  constructor(value, isInteger) {
    this.value = value;
    this.isInteger = isInteger;
  }
}

// RDG-2
export function parseJson(text) {
  require(Buffer.byteLength(text) <= LARGEST_BYTES, "a JSON text must be at most 64 MiB long");
  require(!LONE_SURROGATE.test(text), "a JSON text must not have half a character");
  const parser = new Parser(text);
  const value = parser.value(1);
  parser.skipSpace();
  require(parser.at === text.length, `nothing may follow a JSON value, at ${parser.at}`);
  return value;
}

// CNF-9: a request as plain objects. A number such as 1.0 becomes a text, which is a
// number (CNF-2) and no integer.
export function parseRequest(text) {
  return plain(parseJson(text));
}

function plain(value) {
  if (Array.isArray(value)) return value.map(plain);
  if (value instanceof Map) return Object.fromEntries([...value].map(([key, entry]) => [key, plain(entry)]));
  if (!(value instanceof JsonNumber)) return value;
  return value.isInteger || !Number.isInteger(value.value) ? value.value : String(value.value);
}

class Parser {
  constructor(text) {
    this.text = text;
    this.at = 0;
    this.separators = 0;
  }

  skipSpace() {
    while (SPACES.has(this.text[this.at])) this.at++;
  }

  // Whether the next token is this character, which is then consumed.
  accept(character) {
    this.skipSpace();
    if (this.text[this.at] !== character) return false;
    this.at++;
    return true;
  }

  expect(character) {
    require(this.accept(character), `expected ${character} at ${this.at}`);
  }

  countSeparator() {
    this.separators++;
    require(this.separators <= MOST_VALUES, "a JSON text must have at most 4,000,000 commas and opening brackets");
  }

  value(depth) {
    this.skipSpace();
    const character = this.text[this.at];
    if (character === "{") return this.object(depth);
    if (character === "[") return this.list(depth);
    if (character === '"') return this.string();
    for (const [word, value] of Object.entries(WORDS)) {
      if (this.text.startsWith(word, this.at)) {
        this.at += word.length;
        return value;
      }
    }
    return this.number();
  }

  open(bracket, depth) {
    this.expect(bracket);
    this.countSeparator();
    require(depth <= MOST_DEPTH, "a JSON text must not be nested deeper than 64");
  }

  object(depth) {
    this.open("{", depth);
    const entries = new Map();
    if (this.accept("}")) return entries;
    do {
      this.skipSpace();
      const key = this.string();
      require(!entries.has(key), `key ${key} appears twice`);
      this.expect(":");
      entries.set(key, this.value(depth + 1));
    } while (this.comma());
    this.expect("}");
    return entries;
  }

  list(depth) {
    this.open("[", depth);
    const entries = [];
    if (this.accept("]")) return entries;
    do {
      entries.push(this.value(depth + 1));
    } while (this.comma());
    this.expect("]");
    return entries;
  }

  comma() {
    if (!this.accept(",")) return false;
    this.countSeparator();
    return true;
  }

  string() {
    require(this.text[this.at] === '"', `expected a text at ${this.at}`);
    this.at++;
    let result = "";
    for (;;) {
      const character = this.text[this.at++];
      require(character !== undefined, "a text must end");
      if (character === '"') break;
      require(character >= " ", "a text must not have control characters");
      result += character === "\\" ? this.escape() : character;
    }
    require(!LONE_SURROGATE.test(result), "a text must not have half a character");
    return result;
  }

  escape() {
    const character = this.text[this.at++];
    if (character === "u") {
      const digits = this.text.slice(this.at, this.at + 4);
      require(/^[0-9a-fA-F]{4}$/.test(digits), "\\u must have four hexadecimal digits");
      this.at += 4;
      return String.fromCharCode(parseInt(digits, 16));
    }
    require(Object.hasOwn(ESCAPES, character ?? ""), `unknown escape \\${character}`);
    return ESCAPES[character];
  }

  number() {
    NUMBER.lastIndex = this.at;
    const match = NUMBER.exec(this.text);
    if (!match) throw new Refusal(`expected a JSON value at ${this.at}`);
    const [digits, fraction, exponent] = match;
    require(digits.length <= LONGEST_NUMBER, "a number must have at most 1,000 characters");
    this.at += digits.length;
    const value = Number(digits);
    require(Number.isFinite(value), `${digits}: must be a finite double`);
    const isInteger = fraction === undefined && exponent === undefined;
    // SCN-10: an integer has no zero with a sign; the sum makes -0 to 0.
    return new JsonNumber(isInteger ? value + 0 : value, isInteger);
  }
}
