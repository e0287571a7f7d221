/** Lists of numbers as people write them: `0, 1, 2` or `0-2`. */

const MOST = 1000;

/** The numbers of a text; null where it is none of these. */
export function numbersOf(text: string): number[] | null {
  const found: number[] = [];
  for (const part of text.split(/[\s,;]+/).filter(Boolean)) {
    const [, first, last] = /^(\d+)-(\d+)$/.exec(part) ?? [];
    if (first === undefined) {
      if (!Number.isFinite(Number(part))) return null;
      found.push(Number(part));
    } else {
      if (Number(last) < Number(first) || Number(last) - Number(first) >= MOST) return null;
      for (let each = Number(first); each <= Number(last); each++) found.push(each);
    }
  }
  return found;
}

/** The shortest such text: three or more whole numbers in a row become a range. */
export function numbersText(numbers: readonly number[]): string {
  const parts: string[] = [];
  for (let i = 0; i < numbers.length; ) {
    let end = i;
    while (Number.isInteger(numbers[i]) && numbers[i]! >= 0 && numbers[end + 1] === numbers[end]! + 1) end++;
    if (end - i >= 2) {
      parts.push(`${numbers[i]}-${numbers[end]}`);
      i = end + 1;
    } else parts.push(String(numbers[i++]));
  }
  return parts.join(", ");
}
