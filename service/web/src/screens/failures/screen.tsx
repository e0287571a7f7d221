export function FailuresScreen({ campaign, query }: { campaign: string; query: URLSearchParams }) {
  return (
    <h1>
      Failures {campaign} {query.toString()}
    </h1>
  );
}
