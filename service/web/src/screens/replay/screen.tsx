export function ReplayScreen({ campaign, failure, query }: { campaign: string; failure: string; query: URLSearchParams }) {
  return (
    <h1>
      Replay {campaign} {failure} {query.toString()}
    </h1>
  );
}
