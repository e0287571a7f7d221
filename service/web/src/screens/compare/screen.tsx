export function CompareScreen({ query }: { query: URLSearchParams }) {
  return (
    <h1>
      Compare {query.toString()}
    </h1>
  );
}
