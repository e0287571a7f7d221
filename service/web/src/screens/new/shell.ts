/** The same request for a shell. */

/** One word of a POSIX shell, whatever it holds. */
export function quoted(word: string): string {
  return `'${word.replaceAll("'", String.raw`'\''`)}'`;
}

/** @param key whether the service wants a key; the command reads it from a variable, so that it stays out of histories. */
export function curl(url: string, body: string, key: boolean): string {
  const bearer = key ? [`-H "authorization: Bearer $RISK_SAC_KEY"`] : [];
  const parts = [`curl ${quoted(url)}`, ...bearer, `-H 'content-type: application/json'`, `-d ${quoted(body)}`];
  return parts.join(" \\\n  ");
}
