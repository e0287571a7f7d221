/** Methods of a campaign, or campaigns, against each other. */

import { One } from "./one";
import { Picker } from "./picker";
import { Several } from "./several";
import "./compare.css";

export function CompareScreen({ query }: { query: URLSearchParams }) {
  const ids = [...new Set(listed(query.get("ids")))];
  if (ids.length === 0) return <Picker chosen={listed(query.get("choose"))} />;
  return ids.length === 1 ? <One id={ids[0]!} key={ids[0]} /> : <Several ids={ids} />;
}

function listed(text: string | null): string[] {
  return (text ?? "").split(",").filter(Boolean);
}
