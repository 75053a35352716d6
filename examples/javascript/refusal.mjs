// Input that breaks a rule (CON-9, CNF-9).

export class Refusal extends Error {}

// Refuses with a reason unless the condition holds.
export function require(condition, reason) {
  if (!condition) throw new Refusal(reason);
}

// CON-9: an integer from `low` to `high`, both included.
export function requireInteger(value, name, low, high) {
  require(Number.isInteger(value), `${name} ${value}: must be an integer`);
  require(value >= low && value <= high, `${name} ${value}: must be in [${low}, ${high}]`);
}
