/**
 * How a file is refused: every check of this reader names the rule of the specification that the
 * file breaks and the place where it does so.
 */

/** The error that says which rule a file breaks, where, and what was found there. */
export class Refused extends Error {
  /**
   * @param {string} rule document and anchor of the rule, such as "container.md#page-keys"
   * @param {number} offset place in the file, in bytes from its start
   * @param {string} text what is wrong there
   * @param {number} [page] number of the page that is wrong
   */
  constructor(rule, offset, text, page) {
    const where = page === undefined ? "" : `page ${page}: `;
    super(`offset ${offset}: ${where}${text} (spec/${rule})`);
    this.name = "Refused";
    this.rule = `spec/${rule}`;
    this.offset = offset;
    this.page = page;
    /** Path of the part that is wrong, from the folder of its scene; undefined when it is the file itself. */
    this.file = undefined;
  }
}

/**
 * Throws a Refused error unless the condition holds.
 * @param {boolean} condition what the rule demands
 * @param {string} rule document and anchor of the rule
 * @param {number} offset place in the file, in bytes
 * @param {string} text what is wrong when the condition does not hold
 * @param {number} [page] number of the page that is checked
 */
export function need(condition, rule, offset, text, page) {
  if (!condition) throw new Refused(rule, offset, text, page);
}

/**
 * Returns a check that refuses a page by one rule.
 * @param {string} rule document and anchor of the rule
 * @param {number} offset place in the file, in bytes
 * @param {number} page number of the page
 * @returns {(good: boolean, text: string) => void}
 */
export function checkBy(rule, offset, page) {
  return (good, text) => need(good, rule, offset, text, page);
}
