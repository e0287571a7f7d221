export function CampaignsScreen({ query }: { query: URLSearchParams }) {
  return (
    <h1>
      Campaigns {query.toString()}
    </h1>
  );
}
