/** Names of parts in sentences, as `words.rs` has them: digits alone are no name. */
const isNumber = (name) => /^[0-9]+$/.test(name);

/** @param {string} name */
export function partWord(name) {
  return isNumber(name) ? `part ${name}` : name;
}

/** @param {string[]} names */
export function partWords(names) {
  return names.length > 1 && names.every(isNumber) ? `parts ${names.join(", ")}` : names.map(partWord).join(", ");
}
