export function PairScreen({ campaign, failure, twin, query }: { campaign: string; failure: string; twin: string; query: URLSearchParams }) {
  return (
    <h1>
      Pair {campaign} {failure} {twin} {query.toString()}
    </h1>
  );
}
